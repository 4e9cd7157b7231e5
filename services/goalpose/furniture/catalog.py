"""The list of everything that can be generated: a new kind of furniture is one file with `build(dice)` and one line."""

from __future__ import annotations

from collections.abc import Callable

from goalpose.furniture import armchair, bed, bench, chair, lounger, officechair, sofa, stool
from goalpose.furniture.dice import Dice
from goalpose.furniture.piece import Furniture

BUILDERS: dict[str, Callable[[Dice], Furniture]] = {
    "chair": chair.build,
    "armchair": armchair.build,
    "officechair": officechair.build,
    "lounger": lounger.build,
    "sofa": sofa.build,
    "bench": bench.build,
    "stool": stool.build,
    "barstool": stool.build_bar,
    "bed": bed.build,
}
CATEGORIES: tuple[str, ...] = tuple(BUILDERS)


def generate(category: str, seed: int) -> Furniture:
    """The piece of furniture number `seed` of a category, standing on y = 0 and facing +Z.

    Raises:
        KeyError: `category` is not one of `CATEGORIES`.
    """
    build = BUILDERS[category]
    return build(Dice.seeded(CATEGORIES.index(category), seed)).standing()
