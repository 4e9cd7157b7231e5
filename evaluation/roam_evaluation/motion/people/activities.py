"""What is compared: each activity's measures, where captured people do it, and where the product is told to."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from roam_evaluation.motion.people import sitting, turning, walking
from roam_evaluation.motion.people.frames import Motion
from roam_evaluation.motion.people.registry import Measure, measures

Row = dict[str, float]
Find = Callable[[Motion], list[Row]]
_CHAIR = (0.30, 0.60)  # [m] seats that are compared: stepstools to high chairs, not bar stools
_ANY_PACE = (0.2, 5.0)  # [m/s]


@dataclass(frozen=True)
class Sample:
    """One occurrence of an activity, measured."""

    name: str
    person: str
    values: Row


@dataclass(frozen=True)
class Activity:
    """An activity with the same measures for captured people and for the product."""

    key: str
    title: str
    measures: tuple[Measure, ...]
    of_people: Find
    of_product: Find

    def captured(self, motions: Iterable[Motion]) -> list[Sample]:
        """What captured people do."""
        return _samples(self.of_people, motions)

    def made(self, motions: Iterable[Motion]) -> list[Sample]:
        """What the product does."""
        return _samples(self.of_product, motions)


def _samples(find: Find, motions: Iterable[Motion]) -> list[Sample]:
    return [Sample(motion.name, motion.person, row) for motion in motions for row in find(motion)]


def _walks(speeds: tuple[float, float]) -> Find:
    return lambda motion: [walking.measure(window) for window in walking.windows(motion, speeds)]


def _told(prefix: str, find: Find) -> Find:
    """Only in motions that were told so."""
    return lambda motion: find(motion) if motion.told == prefix else []


def _turns(motion: Motion) -> list[Row]:
    return [turning.measure(turn) for turn in turning.turns(motion)]


def _turns_told(motion: Motion) -> list[Row]:
    return _turns(motion) if motion.told.startswith("turn ") else []


def _sits(measure: Callable[[sitting.Sit], Row | None]) -> Find:
    def find(motion: Motion) -> list[Row]:
        seats = [sit for sit in sitting.sits(motion) if _CHAIR[0] < sitting.seat_height(sit) < _CHAIR[1]]
        return [row for sit in seats if (row := measure(sit)) is not None]

    return find


def _seated(motion: Motion) -> list[Row]:
    return [row for sit in sitting.sits(motion) for row in sitting.measure_seated(sit)]


def _walk(key: str, title: str, speeds: tuple[float, float], told: str) -> Activity:
    """Product: at whatever pace it walks when told that speed."""
    pace = speeds if told == "sit" else _ANY_PACE
    return Activity(key, title, measures("walk"), _walks(speeds), _told(told, _walks(pace)))


ACTIVITIES: Sequence[Activity] = (
    _walk("walk_0.9", "Walking straight on, told 0.9 m/s (people 0.7-1.1)", (0.7, 1.1), "steer 0.9"),
    _walk("walk_1.2", "Walking straight on, told 1.2 m/s (people 1.1-1.35)", (1.1, 1.35), "steer 1.2"),
    _walk("walk_1.5", "Walking straight on, told 1.5 m/s (people 1.35-1.7)", (1.35, 1.7), "steer 1.5"),
    _walk("walk_approach", "Walking straight on, on the way to furniture at 0.7-1.1 m/s", (0.7, 1.1), "sit"),
    Activity("turn", "Turning on the spot", measures("turn"), _turns, _turns_told),
    Activity(
        "sit_down", "Sitting down", measures("sit_down"), _sits(sitting.measure_down), _sits(sitting.measure_down)
    ),
    Activity("stand_up", "Standing up", measures("stand_up"), _sits(sitting.measure_up), _sits(sitting.measure_up)),
    Activity("seated", "Seated", measures("seated"), _seated, _seated),
)
