"""How different people are: six pairs of persons doing the same, beside six pairs of the product's seeds."""

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


def together(pairs: Sequence[Row], *, size: int = 6, groups: int = 200) -> list[Row]:
    """Root mean squares of every difference over random groups of pairs.

    The difference of one pair says little: two persons may walk alike by chance. Six pairs that are all alike are no
    chance. With fewer pairs than that they make one group.
    """
    random = np.random.default_rng(0)
    if len(pairs) <= size:
        return [_root_mean_square(pairs)] if pairs else []
    return [_root_mean_square([pairs[i] for i in random.permutation(len(pairs))[:size]]) for _ in range(groups)]


def _root_mean_square(pairs: Sequence[Row]) -> Row:
    return {key: float(np.sqrt(np.nanmean([row[key] ** 2 for row in pairs]))) for key in pairs[0]}
