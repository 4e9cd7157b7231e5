"""What a network does without."""

import pytest
import torch
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.state import Characters, phase_vector
from roam_motion.models.lnsm.config import WHOLE, NetworkConfig, Parts, network_config
from roam_motion.models.lnsm.features import Inputs, columns, encode, output_widths
from roam_motion.training.learning.loop import TrainingConfig, column_weights, make_learner
from standing import goals_at, random_animator, seated_pose

FIGURE = humanoid_figure()
JOINTS = FIGURE.joint_count
SMALL = TrainingConfig(minutes=1, experts=2, encoding=8, hidden=8)


def seen(parts):
    """Inputs of a standing character with an active goal pose: all of them, and without what is missing."""
    characters = Characters.of(torch.from_numpy(random_animator().start((0.0, 0.0), 0.0, 0).row)[None])
    positions = FIGURE.positions(characters.hips, characters.orientations)
    goals = goals_at(seated_pose(ahead=1.0), 2, active=True)
    inputs = encode(characters, goals, positions, FIGURE.frame(positions))
    return characters, inputs, parts.seen(inputs)


def test_nothing_is_missing_of_the_whole():
    _, inputs, same = seen(WHOLE)
    assert all(torch.equal(a, b) for a, b in zip(vars(inputs).values(), vars(same).values(), strict=True))
    assert not WHOLE.missing(JOINTS).any()


def test_a_hidden_goal_pose_leaves_the_rest_of_the_goal():
    _, inputs, less = seen(Parts(goal_pose=False))
    assert inputs.goal[:, : 9 * JOINTS].abs().max() > 0
    assert less.goal[:, : 9 * JOINTS].abs().max() == 0
    assert torch.equal(inputs.goal[:, 9 * JOINTS :], less.goal[:, 9 * JOINTS :])


def test_a_gate_without_action_sees_the_phase_itself():
    characters, _, less = seen(Parts(gate_action=False))
    phase = phase_vector(torch.cat([characters.past[:, ::5, 8], characters.future[..., 8]], 1))
    torch.testing.assert_close(less.gating[:, :26], phase.flatten(1))
    assert less.gating[:, 26:].abs().max() == 0


def test_a_gate_without_phase_sees_labels_whatever_the_phase():
    _, inputs, less = seen(Parts(gate_phase=False))
    other = Parts(gate_phase=False).seen(Inputs(inputs.frame, inputs.goal, -inputs.gating))
    assert torch.equal(less.gating, other.gating)
    assert less.gating.abs().max() > 0


def test_contacts_that_are_missing_are_neither_said_nor_learned():
    parts = Parts(contacts=False, inverse=False)
    where = columns(output_widths(JOINTS), "contacts")
    output = torch.ones(1, len(where))
    assert parts.answered(JOINTS, output)[:, where].abs().max() == 0
    assert column_weights(FIGURE, parts)[parts.missing(JOINTS)].abs().max() == 0
    assert (column_weights(FIGURE, parts) > 0).sum() == (~parts.missing(JOINTS)).sum()
    assert not parts.blending().inverse


@pytest.mark.parametrize("parts", [WHOLE, Parts(frame_encoder=False), Parts(goal_encoder=False)])
def test_networks_without_encoders_answer_as_widely(parts):
    learner = make_learner(FIGURE, SMALL, parts)
    _, inputs, _ = seen(parts)
    assert learner.raw()(inputs).shape == (1, network_config(JOINTS).output)


def test_a_configuration_keeps_what_is_missing():
    config = network_config(JOINTS, parts=Parts(inverse=False), experts=2)
    assert NetworkConfig.from_dict(config.as_dict()) == config
    assert "parts" not in network_config(JOINTS).as_dict()
