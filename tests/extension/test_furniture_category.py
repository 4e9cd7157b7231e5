"""A new kind of furniture is one row of the table: generated, trained on, evaluated, and no other piece changes."""

from pathlib import Path

import numpy as np
import pytest
from roam_evaluation.goalpose.inputs.objects import EvaluationObject
from roam_goalpose.furniture import TABLE, Category, Furniture, generate
from roam_goalpose.furniture.solids import Box, vector
from roam_goalpose.training.store import procedural_examples


def build(rng):
    """A cube to sit on."""
    half, top = rng.between(0.2, 0.3), rng.between(0.38, 0.46)
    cube = Box(center=vector(0, top / 2, 0), half=vector(half, top / 2, half))
    return Furniture("pouf", (cube,), vector(0, top, 0)[None])


POUF = Category(name="pouf", build=build, share=5, group="stools and benches", one_seat=True)


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(TABLE, POUF.name, POUF)


def pieces() -> dict[str, np.ndarray]:
    return {name: generate(name, 7).mesh[0] for name in TABLE if name != POUF.name}


@pytest.mark.parametrize("first", [True, False])
def test_no_other_piece_changes_wherever_the_row_stands(monkeypatch, first):
    before, others = pieces(), dict(TABLE)
    rows = {POUF.name: POUF, **others} if first else {**others, POUF.name: POUF}
    TABLE.clear()
    TABLE.update(rows)
    try:
        after, pouf = pieces(), generate("pouf", 7).mesh[0]
    finally:
        TABLE.clear()
        TABLE.update(others)
    assert all(np.array_equal(before[name], after[name]) for name in before)
    assert np.array_equal(pouf, POUF.piece(7).mesh[0])


def test_seeds_come_from_names():
    same = Category(name="pouf", build=build)
    other = Category(name="hassock", build=build)
    assert np.array_equal(POUF.piece(3).mesh[0], same.piece(3).mesh[0])
    assert not np.allclose(POUF.piece(3).mesh[0], other.piece(3).mesh[0])


def test_it_is_trained_on(registered):
    examples = list(procedural_examples(3, seed=1, categories=("pouf",)))
    assert [example.category for example in examples] == ["pouf"] * 3


async def test_people_sit_on_it(registered, goalpose_client, ask):
    item = EvaluationObject(Path("pouf-1000001"), "pouf", "generated", None, seed=1_000_001)
    async with goalpose_client() as client:
        answer = await ask(client, item.read(), "ply")
    top = generate("pouf", 1_000_001).seat_height
    assert answer["place"][1] == pytest.approx(top, abs=0.03)
    assert answer["quality"]["contacts_met"] > 0.5
