import torch
from roam_character.matrices import matrix_from_6d
from roam_motion.animation.prediction import goal_orientations, world_axes
from roam_motion.animation.state import Characters
from roam_motion.models.lnsm.config import network_config
from roam_motion.models.lnsm.features import Targets, decode, encode, encode_targets
from standing import goals_at, random_animator, seated_pose


def standing(x=0.0, z=0.0, yaw=0.0):
    animator = random_animator()
    state = animator.start((x, z), yaw, 0)
    return animator.figure, Characters.of(torch.from_numpy(state.row)[None])


def encoded(figure, characters, goals):
    positions = figure.positions(characters.hips, characters.orientations)
    root = figure.frame(positions)
    return encode(characters, goals, positions, root), positions, root


def test_widths_are_as_configured():
    figure, characters = standing()
    inputs, _, _ = encoded(figure, characters, goals_at(seated_pose(), 2, active=True))
    config = network_config(figure.joint_count)
    assert (inputs.frame.shape[1], inputs.goal.shape[1], inputs.gating.shape[1]) == (
        config.frame,
        config.goal,
        config.gating,
    )


def test_inputs_do_not_depend_on_where_the_world_is():
    figure, here = standing()
    pose = seated_pose(ahead=2.0)
    a, _, _ = encoded(figure, here, goals_at(pose, 2, active=True))
    _, there = standing(3.0, -1.0, 0.7)
    moved = pose.turned(0.7).moved([3.0, 0.0, -1.0])
    b, _, _ = encoded(figure, there, goals_at(moved, 2, active=True))
    for one, other in zip(vars(a).values(), vars(b).values(), strict=True):
        torch.testing.assert_close(one, other, atol=2e-4, rtol=0)


def test_the_goal_pose_is_hidden_unless_active():
    figure, characters = standing()
    near, _, _ = encoded(figure, characters, goals_at(seated_pose(), 1, active=False))
    assert float(near.goal[:, : figure.joint_count * 9].abs().max()) == 0.0


def test_targets_come_back_through_decode():
    figure, characters = standing(0.5, 0.2, -0.4)
    goals = goals_at(seated_pose(), 2, active=True)
    _, positions, root = encoded(figure, characters, goals)
    generator = torch.Generator().manual_seed(1)
    orientations = matrix_from_6d(torch.randn(1, figure.joint_count, 6, generator=generator))
    target = Targets(
        positions + 0.05,
        orientations,
        torch.rand(1, 7, 8, generator=generator),
        torch.ones(1, 4),
        torch.rand(1, 7, generator=generator),
    )
    answer = decode(encode_targets(figure, characters, goals, positions, root, target), characters, positions, root)
    torch.testing.assert_close(root.points_out(answer.positions), target.positions, atol=1e-5, rtol=0)
    torch.testing.assert_close(matrix_from_6d(world_axes(root, answer.axes)), orientations, atol=1e-4, rtol=0)
    torch.testing.assert_close(goal_orientations(goals, answer.inverse_axes), orientations, atol=1e-4, rtol=0)
    inverse = goals.pose_positions + figure.frame(goals.pose_positions).turn_out(answer.inverse_positions)
    torch.testing.assert_close(inverse, target.positions, atol=1e-5, rtol=0)
    torch.testing.assert_close(answer.phase, target.phase)
