"""What is compared: each activity's measures, where captured people do it, and where the product is told to."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from roam_evaluation.motion.people.frames import Motion
from roam_evaluation.motion.people.measures import feet, lying, running, sitting, standing, turning, variety, walking
from roam_evaluation.motion.people.registry import Measure, measures

Row = dict[str, float]
Find = Callable[[Motion], list[Row]]
_CHAIR = (0.30, 0.60)  # [m] seats that are compared: stepstools to high chairs, not bar stools
_ANY_PACE = (0.2, 5.0)  # [m/s]
_RUNS = (1.8, 3.6)  # [m/s]
_STROLL = (0.7, 1.1)  # [m/s]


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
    pairs: tuple[str, ...] = ()  # measures whose difference between persons is the sample

    def captured(self, motions: Iterable[Motion]) -> list[Sample]:
        """What captured people do."""
        return self._samples(self.of_people, motions)

    def made(self, motions: Iterable[Motion]) -> list[Sample]:
        """What the product does."""
        return self._samples(self.of_product, motions)

    def _samples(self, find: Find, motions: Iterable[Motion]) -> list[Sample]:
        found = [Sample(motion.name, motion.person, row) for motion in motions for row in find(motion)]
        if not self.pairs or not found:
            return found
        pairs: list[Row] = []
        for group in sorted({_group(s) for s in found}):  # seeds are compared that were told the same
            people = variety.by_person([(s.person, s.values) for s in found if _group(s) == group])
            pairs += [row for _, row in variety.differences(people, self.pairs)]
        return [Sample("six pairs", "pairs", row) for row in variety.together(pairs)]


def _group(sample: Sample) -> str:
    """What the product was told; captured people are one group."""
    return sample.name.split(", seed")[0] if ", seed" in sample.name else ""


def _told(wanted: Callable[[str], bool], find: Find) -> Find:
    """Only in motions that were told so."""
    return lambda motion: find(motion) if wanted(motion.told) else []


def _from(folders: tuple[str, ...], find: Find) -> Find:
    """Only in clips of these folders."""
    return lambda motion: find(motion) if motion.name.startswith(folders) else []


def _walks(speeds: tuple[float, float]) -> Find:
    return lambda motion: [walking.measure(window) for window in walking.windows(motion, speeds)]


def _turns(motion: Motion) -> list[Row]:
    return [turning.measure(turn) for turn in turning.turns(motion)]


def _sits(measure: Callable[[sitting.Sit], Row | None]) -> Find:
    def find(motion: Motion) -> list[Row]:
        seats = [sit for sit in sitting.sits(motion) if _CHAIR[0] < sitting.seat_height(sit) < _CHAIR[1]]
        return [row for sit in seats if (row := measure(sit)) is not None]

    return find


def _seated(motion: Motion) -> list[Row]:
    return [row for sit in sitting.sits(motion) for row in sitting.measure_seated(sit)]


def _running(motion: Motion) -> list[Row]:
    return [running.measure(window) for window in running.windows(motion, _RUNS)]


def _idles(motion: Motion) -> list[Row]:
    return [standing.measure_idle(window) for window in standing.idles(motion)]


def _stops(motion: Motion) -> list[Row]:
    return [standing.measure_stop(motion, frame) for frame in standing.stops(motion)]


def _starts(motion: Motion) -> list[Row]:
    return [standing.measure_start(motion, frame) for frame in standing.starts(motion)]


def _feet(motion: Motion) -> list[Row]:
    row = feet.measure(motion)
    return [row] if row else []


def _lies(motion: Motion) -> list[Row]:
    return [row for lie in lying.held(motion) if (row := lying.measure_down(motion, lie)) is not None]


def _walk(key: str, title: str, speeds: tuple[float, float], told: str) -> Activity:
    """Product: at whatever pace it walks when told that speed."""
    pace = speeds if told == "sit" else _ANY_PACE
    return Activity(key, title, measures("walk"), _walks(speeds), _told(told.__eq__, _walks(pace)))


def _paced(slowest: float, fastest: float) -> Callable[[str], bool]:
    """Told to walk at such a speed."""
    return lambda told: told.startswith("steer ") and slowest <= float(told.split()[1]) <= fastest


_WALKED = ("cmu_",)
_ON_FOOT = _paced(0.8, 1.5)
_DOWN, _UP = _sits(sitting.measure_down), _sits(sitting.measure_up)

ACTIVITIES: Sequence[Activity] = (
    _walk("walk_0.9", "Walking straight on, told 0.9 m/s (people 0.7-1.1)", _STROLL, "steer 0.9"),
    _walk("walk_1.2", "Walking straight on, told 1.2 m/s (people 1.1-1.35)", (1.1, 1.35), "steer 1.2"),
    _walk("walk_1.5", "Walking straight on, told 1.5 m/s (people 1.35-1.7)", (1.35, 1.7), "steer 1.5"),
    _walk("walk_approach", "Walking straight on, on the way to furniture (both at 0.7-1.4 m/s)", (0.7, 1.4), "sit"),
    Activity(
        "run", "Running, told 2.2 to 3.4 m/s (people 1.8-3.6)", measures("run"), _running, _told(_paced(2, 4), _running)
    ),
    Activity("start", "Setting off", measures("start"), _from(_WALKED, _starts), _told(_ON_FOOT, _starts)),
    Activity("stop", "Stopping", measures("stop"), _from(_WALKED, _stops), _told(_ON_FOOT, _stops)),
    Activity("turn", "Turning on the spot", measures("turn"), _turns, _told(lambda t: t.startswith("turn "), _turns)),
    Activity("idle", "Standing about", measures("idle"), _idles, _told("idle".__eq__, _idles)),
    Activity(
        "feet",
        "Feet while on foot, whole motions",
        measures("feet"),
        _from(_WALKED, _feet),
        _told(lambda told: told == "sit" or _ON_FOOT(told), _feet),
    ),
    Activity("sit_down", "Sitting down", measures("sit_down"), _DOWN, _DOWN),
    Activity("stand_up", "Standing up", measures("stand_up"), _UP, _UP),
    Activity("seated", "Seated", measures("seated"), _seated, _told("sit".__eq__, _seated)),
    Activity("lie_down", "Lying down (people: on the floor)", measures("lie_down"), _lies, _lies),
    Activity(
        "variety_walk",
        "How much persons who walk differ, and seeds told 0.9 m/s",
        measures("variety_walk"),
        _walks(_STROLL),
        _told("steer 0.9".__eq__, _walks(_ANY_PACE)),
        ("cadence", "step_length", "arm_swing", "knee_in_stance", "pelvis_turn", "step_width"),
    ),
    Activity(
        "variety_sit",
        "How much persons who sit down differ, and seeds on one chair",
        measures("variety_sit"),
        _DOWN,
        _told("sit".__eq__, _DOWN),
        ("descent", "lean_down", "hips_back", "contact_to_rest"),
    ),
)
