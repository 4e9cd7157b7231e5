"""Reference models from an earlier process are, to the bit, those that would be made."""

from pathlib import Path

import pytest
import torch
from roam_goalpose.references.kept_models import KeptModels
from roam_goalpose.references.pairs import own_pair
from roam_goalpose.synthesis import Synthesizer
from roam_serving.kept import FOLDER
from solving import LandmarkField, pair


@pytest.fixture
def kept(tmp_path: Path) -> KeptModels:
    return KeptModels("some field", tmp_path)


@pytest.fixture
def synthesizer() -> Synthesizer:
    return Synthesizer(LandmarkField(), {})


def tensors(value: object) -> list[torch.Tensor]:
    if isinstance(value, torch.Tensor):
        return [value]
    parts = value.values() if isinstance(value, dict) else vars(value).values() if hasattr(value, "__dict__") else ()
    return [found for part in parts for found in tensors(part)]


def test_what_was_kept_is_what_was_made(kept: KeptModels, synthesizer: Synthesizer) -> None:
    chair = pair("chair_sit")
    made = synthesizer.model(chair, 0, 8)
    kept.put(chair, made, seed=0, samples=8)
    found = kept.get(chair, seed=0, samples=8)
    assert found is not None
    for before, after in zip(tensors(made.prepared), tensors(found.prepared), strict=True):
        assert torch.equal(before, after)
    assert len(tensors(made.prepared)) > 5
    assert kept.get(chair, seed=0, samples=9) is None
    assert kept.get(pair("sofa_sit"), seed=0, samples=8) is None


def test_pairs_of_a_caller_are_not_written_down(kept: KeptModels, synthesizer: Synthesizer, tmp_path: Path) -> None:
    chair = pair("chair_sit")
    own = own_pair(chair.shape, chair.pose, action="sit", title="mine")
    kept.put(own, synthesizer.model(chair, 0, 8), seed=0, samples=8)
    assert not [file for file in tmp_path.rglob("*") if file.is_file()]


def test_a_second_synthesizer_reads_no_object_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    first = Synthesizer.load()
    first.model(first.references["chair_sit"], 0, 8)
    second = Synthesizer.load()
    second.model(second.references["chair_sit"], 0, 8)
    assert "shape" in vars(first.references["chair_sit"].source)
    assert "shape" not in vars(second.references["chair_sit"].source)
