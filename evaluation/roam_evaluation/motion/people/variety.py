"""How different people are: pairs of persons doing the same, beside pairs of the product's seeds."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

Row = dict[str, float]


def by_person(rows: Sequence[tuple[str, Row]]) -> dict[str, Row]:
    """Means over each person's samples."""
    people = sorted({person for person, _ in rows})
    return {
        who: {key: float(np.nanmean([r.get(key, np.nan) for person, r in rows if person == who])) for key in rows[0][1]}
        for who in people
    }


def differences(people: dict[str, Row], keys: Sequence[str]) -> list[tuple[str, Row]]:
    """For every pair of persons the absolute difference of each measure."""
    return [
        (f"{a} and {b}", {f"{key}_differs": abs(people[a][key] - people[b][key]) for key in keys})
        for a, b in combinations(people, 2)
    ]
