"""The mirror image of a state, encoded, is the mirror image of the encoded state; and so are the answers."""

from dataclasses import replace

import pytest
import torch
from leaning import leaning_clip
from roam_character.skeleton import humanoid_skeleton
from roam_motion.actions import SIT
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.state import DIRECTION, PHASE, PLACE
from roam_motion.models.lnsm.features import Inputs, encode, encode_targets
from roam_motion.training.data.dataset import build
from roam_motion.training.data.episodes import locomotion
from roam_motion.training.data.recordings import Recording
from roam_motion.training.learning.loop import (
    Memory,
    TrainingConfig,
    column_weights,
    fit_normaliser,
    learn,
    make_learner,
)
from roam_motion.training.learning.mirror import mirror_of
from roam_motion.training.learning.rollout import Rollout
from standing import goals_at, seated_pose

FIGURE = humanoid_figure()
MIRROR = mirror_of(FIGURE)
ACROSS = torch.diag(torch.tensor([-1.0, 1.0, 1.0]))
OTHER = torch.tensor(FIGURE.skeleton.mirror)


@pytest.fixture(scope="module")
def dataset():
    clip = leaning_clip()
    roots = clip.root_positions.copy()
    roots[:, 0] += 0.004 * torch.arange(len(clip)).numpy()  # something that is not symmetric
    clip = replace(clip, root_positions=roots)
    return build(FIGURE, locomotion(Recording("made/up", clip, None, None, ()), humanoid_skeleton()), [1.0])


def points(values):
    return (values @ ACROSS)[:, OTHER]


def turns(values):
    return (ACROSS @ values @ ACROSS)[:, OTHER]


def floor(values):
    out = values.clone()
    for part in (PLACE, DIRECTION):
        out[..., part.start] *= -1
    return out


def series(values):
    out = floor(values)
    out[..., PHASE] += 0.5
    return out


def states(dataset):
    at = torch.tensor([70, 80, 95])
    characters = dataset.characters(FIGURE, at)
    one = goals_at(seated_pose(ahead=0.5), SIT.column, active=True)
    goals = replace(dataset.goals(at), **{k: v.expand(3, *v.shape[1:]) for k, v in vars(one).items() if k != "feet"})
    other = replace(
        characters,
        hips=characters.hips @ ACROSS,
        orientations=turns(characters.orientations),
        velocities=points(characters.velocities),
        past=series(characters.past),
        future=series(characters.future),
        contacts=characters.contacts[:, [2, 3, 0, 1]],
    )
    across = replace(
        goals,
        positions=goals.positions * torch.tensor([-1.0, 1.0]),
        directions=goals.directions * torch.tensor([-1.0, 1.0]),
        pose_positions=points(goals.pose_positions),
        pose_orientations=turns(goals.pose_orientations),
    )
    return at, (characters, goals), (other, across)


def encoded(characters, goals):
    positions = FIGURE.positions(characters.hips, characters.orientations)
    return encode(characters, goals, positions, FIGURE.frame(positions))


def test_inputs_of_a_mirrored_state_are_the_mirrored_inputs(dataset):
    _, here, there = states(dataset)
    mirrored, wanted = MIRROR.inputs(encoded(*here)), encoded(*there)
    for name in ("frame", "goal", "gating"):
        torch.testing.assert_close(getattr(mirrored, name), getattr(wanted, name), atol=2e-5, rtol=0)
        assert (getattr(mirrored, name) - getattr(encoded(*here), name)).abs().max() > 0.1


def test_outputs_for_a_mirrored_state_are_the_mirrored_outputs(dataset):
    at, (characters, goals), (other, across) = states(dataset)
    ahead = dataset.targets(FIGURE, at)
    mirrored = replace(
        ahead,
        positions=points(ahead.positions),
        orientations=turns(ahead.orientations),
        trajectory=floor(ahead.trajectory),
        contacts=ahead.contacts[:, [2, 3, 0, 1]],
    )
    rows = []
    for who, aims, targets in ((characters, goals, ahead), (other, across, mirrored)):
        positions = FIGURE.positions(who.hips, who.orientations)
        rows.append(encode_targets(FIGURE, who, aims, positions, FIGURE.frame(positions), targets))
    torch.testing.assert_close(MIRROR.output(rows[0]), rows[1], atol=2e-5, rtol=0)


def test_two_mirrorings_change_nothing(dataset):
    _, here, _ = states(dataset)
    inputs = encoded(*here)
    again = MIRROR.inputs(MIRROR.inputs(inputs))
    for name in ("frame", "goal", "gating"):
        assert torch.equal(getattr(again, name), getattr(inputs, name))


def test_a_batch_is_learned_with_its_mirror_image(dataset):
    """An update from examples and one from their mirror images are the same update."""
    config = TrainingConfig(minutes=1, experts=2, encoding=8, hidden=8, batch=8, memory=16)
    after = []
    for mirrored in (False, True):
        learner = make_learner(FIGURE, config)
        rollout = Rollout(FIGURE, dataset, 4, torch.Generator().manual_seed(0))
        fit_normaliser(learner, rollout, rounds=2)
        inputs, output, active = rollout.example()
        columns = MIRROR.inputs(inputs) if mirrored else inputs
        memory = Memory(4)
        memory.add(*vars(Inputs(**vars(columns))).values(), MIRROR.output(output) if mirrored else output, active)
        learn(learner, memory, config, column_weights(FIGURE), FIGURE, MIRROR, torch.Generator().manual_seed(1))
        after.append(torch.cat([p.detach().flatten() for p in learner.network.parameters()]))
    torch.testing.assert_close(after[0], after[1], atol=1e-5, rtol=0)
