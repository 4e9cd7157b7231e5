"""The variants of an ablation differ where they say."""

import pytest
import torch
from roam_evaluation.goalpose.ablation import CHANGES, ablated
from roam_goalpose.energy.terms.descriptor import Descriptor
from roam_goalpose.synthesis import Synthesizer
from seating import sitter


class Landmarks:
    """Descriptors are the positions themselves."""

    def encode(self, points):
        return points.mean(1)

    def descriptor(self, latent, x):
        return torch.nn.functional.normalize(x - latent[:, None], dim=-1)

    def front(self, latent):
        return torch.tensor([[0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def synthesizer():
    return Synthesizer(Landmarks(), {"chair_sit": sitter()})


@pytest.mark.parametrize("variant", CHANGES)
def test_every_variant_but_the_default_changes_something(synthesizer, variant):
    made = ablated(synthesizer, variant)
    same = made.config == synthesizer.config and type(made) is type(synthesizer)
    assert same == (variant == "default")


def test_joint_sampling_leaves_the_limbs_out(synthesizer):
    pair = synthesizer.references["chair_sit"]
    full, joints = (ablated(synthesizer, v).model(pair, 0, 2) for v in ("default", "joint sampling"))
    joints, full = Descriptor().of(joints), Descriptor().of(full)
    assert joints.width == 2 * 22
    assert full.width == 2 * (22 + 8)
    assert joints.descriptors.values.shape[1] == joints.nearness.shape[1] == joints.width
