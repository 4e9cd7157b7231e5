"""Requests that share their Newton steps: the same answers as alone, and none disturbs another."""

import threading
from dataclasses import replace
from pathlib import Path

import pytest
from roam_goalpose.field import Field
from roam_goalpose.solvers import sharing
from roam_goalpose.solvers.progress import Cancelled
from roam_goalpose.solvers.staged import SolverConfig
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer
from solving import pair

WEIGHTS = Path(__file__).parents[3] / "weights" / "field.safetensors"
FURNITURE = ("chair_sit", "office_sit", "stool_sit")


@pytest.fixture(scope="module")
def synthesizer():
    return Synthesizer(Field.load(WEIGHTS), {"chair_sit": pair("chair_sit")})


@pytest.fixture(scope="module")
def hasty():
    """The same with a few iterations of every stage."""
    rounds = {
        name: replace(getattr(SolverConfig(), name), iterations=2) for name in ("rigid", "joints", "finish", "polish")
    }
    return Synthesizer(Field.load(WEIGHTS), {"chair_sit": pair("chair_sit")}, config=SolverConfig(**rounds))


@pytest.fixture
def sizes(monkeypatch):
    """How many problems were solved at a time."""
    found: list[int] = []
    plain = sharing.minimise_together
    monkeypatch.setattr(sharing, "minimise_together", lambda problems: found.append(len(problems)) or plain(problems))
    return found


def asked(seed: int) -> GoalPoseRequest:
    return GoalPoseRequest(reference="chair_sit", seed=seed)


def together(synthesizer, leaving: int | None = None):
    """An answer or an error for every piece of furniture, asked for at once; one caller leaves in the last stage."""
    outcomes: list[object] = [None] * len(FURNITURE)

    def ask(k: int) -> None:
        told: list[int] = []
        try:
            outcomes[k] = synthesizer.synthesize(
                pair(FURNITURE[k]).shape,
                asked(k),
                progress=lambda progress: told.append(progress.iteration),
                cancelled=lambda: k == leaving and bool(told) and told[-1] > 12,
            )
        except Cancelled as error:
            outcomes[k] = error

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(len(FURNITURE))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return outcomes


def same(a, b) -> bool:
    bits = [(r.energies, r.pose.rotations.tobytes(), r.pose.root_position.tobytes()) for r in (a, b)]
    return bits[0] == bits[1]


@pytest.mark.equal_bits
def test_answers_have_the_same_bits_alone_and_in_company(hasty, sizes):
    alone = [hasty.synthesize(pair(name).shape, asked(k)) for k, name in enumerate(FURNITURE)]
    assert set(sizes) == {1}
    for _ in range(2):  # company is tried, then trusted or not
        assert all(same(a, b) for a, b in zip(alone, together(hasty), strict=True))
    assert max(sizes) > 1


def test_company_in_which_bits_differ_is_not_trusted(hasty, monkeypatch):
    """As on a processor whose kernels round otherwise for other shapes."""
    alone = [hasty.synthesize(pair(name).shape, asked(k)) for k, name in enumerate(FURNITURE)]
    plain = sharing.minimise_together

    def rounding(problems):
        found = plain(problems)
        if len(problems) == 1:
            return found
        return [replace(candidates, energy=candidates.energy * (1 + 1e-7)) for candidates in found]

    with monkeypatch.context() as patch:
        patch.setattr(sharing, "minimise_together", rounding)
        patch.setattr(hasty, "_steps", sharing.SharedSteps())
        for _ in range(2):
            assert all(same(a, b) for a, b in zip(alone, together(hasty), strict=True))
        assert set(hasty._steps._agreed.values()) == {False}


def test_who_leaves_stops_only_what_is_theirs(synthesizer, sizes):
    found = together(synthesizer, leaving=1)
    assert isinstance(found[1], Cancelled)
    for k in (0, 2):
        assert same(found[k], synthesizer.synthesize(pair(FURNITURE[k]).shape, asked(k)))


def test_an_error_of_a_shared_step_reaches_everyone_and_blocks_nobody(synthesizer, monkeypatch):
    def broken(problems):
        raise ZeroDivisionError("deep inside")

    with monkeypatch.context() as patch:
        patch.setattr(sharing, "minimise_together", broken)
        with pytest.raises(ZeroDivisionError):
            synthesizer.synthesize(pair("chair_sit").shape, asked(0))
    assert synthesizer.synthesize(pair("chair_sit").shape, asked(0)).energies["total"] < 1
