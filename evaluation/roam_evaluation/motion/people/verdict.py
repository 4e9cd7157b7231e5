"""People's range of every measure, the product's, and whether the product's median lies within people's."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roam_evaluation.motion.people.activities import Activity, Sample
from roam_evaluation.motion.people.registry import Measure

# Held-out samples, and persons they come from, that a range needs: a handful of persons is a handful of gaits. With
# fewer, all captured clips give the range.
ENOUGH, PERSONS = 20, 8
FARTHEST = 0.5  # widths of people's range that a median may lie outside of it at most


@dataclass(frozen=True)
class Spread:
    """5th, 50th and 95th percentile of so many samples of so many persons."""

    low: float
    median: float
    high: float
    samples: int
    persons: int


@dataclass(frozen=True)
class Verdict:
    """One measure, judged."""

    activity: str
    measure: Measure
    product: Spread | None
    held_out: Spread | None
    training: Spread | None
    people: Spread | None  # the range that is judged with
    which: str  # "held-out" or "all"
    outside: float | None  # widths of people's range that the product's median is outside of it; 0 inside

    @property
    def inside(self) -> bool:
        """Whether the product's median lies within people's range. What cannot be measured does not."""
        return self.outside == 0.0


def spread(samples: Sequence[Sample], key: str) -> Spread | None:
    """Of the finite values; None without any."""
    kept = [(s.person, s.values[key]) for s in samples if np.isfinite(s.values.get(key, np.nan))]
    if not kept:
        return None
    low, median, high = np.quantile([value for _, value in kept], [0.05, 0.5, 0.95])
    return Spread(float(low), float(median), float(high), len(kept), len({person for person, _ in kept}))


def outside(median: float, people: Spread, *, one_sided: bool = False) -> float:
    """How far a median lies outside of people's range, in widths of the range; 0 inside."""
    width = max(people.high - people.low, 1e-9)
    below = 0.0 if one_sided else (people.low - median) / width
    return max(below, (median - people.high) / width, 0.0)


def judge(
    activity: Activity, product: Sequence[Sample], held_out: Sequence[Sample], training: Sequence[Sample]
) -> list[Verdict]:
    """All measures of an activity."""
    found = []
    for measure in activity.measures:
        made, held, kept = (spread(group, measure.key) for group in (product, held_out, training))
        enough = held is not None and held.samples >= ENOUGH and held.persons >= PERSONS
        people = held if enough else spread([*held_out, *training], measure.key)
        apart = outside(made.median, people, one_sided=measure.one_sided) if made and people else None
        found.append(Verdict(activity.key, measure, made, held, kept, people, "held-out" if enough else "all", apart))
    return found


def people_range(verdicts: Sequence[Verdict], activity: str, key: str) -> tuple[float, float] | None:
    """People's 5th and 95th percentile of a measure; None where it is not known."""
    for v in verdicts:
        if v.activity == activity and v.measure.key == key and v.people:
            return v.people.low, v.people.high
    return None


def summary(verdicts: Sequence[Verdict]) -> dict[str, float]:
    """Share of judged measures inside people's range, and the farthest outside. Measures that people themselves
    cannot be measured by do not count; those that only the product cannot do count as outside."""
    judged = [v for v in verdicts if v.measure.judged and v.people is not None]
    far = [v.outside for v in judged if v.outside is not None]
    return {
        "measures": len(judged),
        "inside": sum(v.inside for v in judged),
        "inside_percent": round(100 * sum(v.inside for v in judged) / max(len(judged), 1), 1),
        "not_measurable": sum(v.outside is None for v in judged),
        "farthest_widths": round(max(far, default=0.0), 2),
        "farther_than_half": sum(x > FARTHEST for x in far),
    }
