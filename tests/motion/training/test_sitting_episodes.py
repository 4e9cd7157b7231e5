"""Sitting episodes keep the lean, the balance and the feet of the people they are made of."""

import numpy as np
import pytest
from leaning import leaning_clip
from roam_character.kinematics import facing
from roam_character.rotation import yaw_direction
from roam_character.skeleton import humanoid_skeleton
from roam_motion.actions import SIT
from roam_motion.animation.figure import humanoid_figure
from roam_motion.training.data import labels
from roam_motion.training.data.centre_of_mass import ahead_of_rear_ankle, centre_of_mass, lean
from roam_motion.training.data.goals import Bank, Key
from roam_motion.training.data.recordings import Recording, Span
from roam_motion.training.data.sitting import like_people, passages, sitting
from standing import seated_pose

SKELETON, FIGURE = humanoid_skeleton(), humanoid_figure()
BANK = Bank([Key(p.root_position, p.rotations) for p in (seated_pose(), seated_pose(0.5))])


def made(lean=42.0):
    clip = leaning_clip(lean)
    spans = tuple(Span(*span) for span in labels.find_spans(clip))
    return Recording("made/up", clip, None, None, spans)


@pytest.fixture(scope="module")
def ways():
    recording = made()
    assert len(recording.spans) == 1
    return passages(recording, recording.spans[0])


def episodes(ways, count=6):
    down, up = ways
    rng = np.random.default_rng(3)
    found = [e for e in (sitting(SKELETON, down, up, BANK, rng) for _ in range(4 * count)) if e is not None]
    assert len(found) >= count
    return found[:count]


def test_a_way_down_and_a_way_up_are_found(ways):
    assert [way.up for way in ways] == [False, True]
    for way in ways:
        assert way.hips[way.begins, 1] > 0.85 > 0.65 > way.hips[way.touches, 1]


def test_who_does_not_lean_is_not_learned_from_unless_there_is_nobody_else():
    upright = made(lean=8.0)
    assert passages(upright, upright.spans[0]) == []
    assert len(passages(upright, upright.spans[0], good=False)) == 2


def test_episodes_lean_and_balance_as_their_source_does(ways):
    for episode in episodes(ways):
        positions = episode.clip.positions()
        ahead = yaw_direction(facing(SKELETON, positions))[:, [0, 2]]
        goal = float(episode.goals[0][0].hips[1])
        high = positions[:, 0, 1] > goal + 0.05
        command = int(np.argmax(episode.goal == 0))
        seated = command + int(np.argmin(high[command:]))
        leaves = len(high) - 1 - int(np.argmin(high[::-1]))
        for cut in (slice(command, seated + 6), slice(leaves - 6, len(high) - 30)):
            assert lean(SKELETON, positions[cut], ahead[cut]).max() > 35
        half = command + int(np.argmin(np.abs(positions[command:seated, 0, 1] - (0.95 + goal) / 2)))
        assert ahead_of_rear_ankle(SKELETON, positions[half : half + 1], ahead[half : half + 1])[0] > -0.05


def test_the_goal_pose_is_held_with_both_feet_on_their_places(ways):
    for episode in episodes(ways):
        goal = episode.goals[0][0]
        middle = int(np.flatnonzero(episode.goal == 0).mean())
        window = slice(max(middle - 60, 0), middle + 60)
        assert np.linalg.norm(episode.clip.root_positions[window] - goal.hips, axis=-1).min() < 0.005
        positions = episode.clip.positions()
        assert np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() < 0.15
        feet = positions[:, FIGURE.contacts.numpy()[[0, 2]]]
        planted = episode.contacts[1:, [0, 2]] & episode.contacts[:-1, [0, 2]]
        assert planted.mean() > 0.6
        assert np.linalg.norm(np.diff(feet, axis=0), axis=-1)[planted].mean() < 0.002


def test_commands_come_before_the_body_moves(ways):
    for episode in episodes(ways):
        active = np.flatnonzero(episode.goal == 0)
        heights = episode.clip.root_positions[:, 1]
        begins = int(np.flatnonzero(heights > 0.93)[np.flatnonzero(heights > 0.93) < active.mean()][-1])
        assert 3 <= begins - active[0] <= 25
        assert heights[active[-1]] == pytest.approx(float(episode.goals[0][0].hips[1]), abs=0.03)
        assert (episode.intent[active] == SIT.column).all()
        assert (episode.goal[active[-1] + 1 :] <= 1).all()


def test_the_clip_itself_is_like_people():
    clip = leaning_clip()
    assert like_people(SKELETON, clip.root_positions, clip.rotations, 62, 86)
    assert not like_people(SKELETON, clip.root_positions, leaning_clip(15.0).rotations, 62, 86)


def test_balance_is_the_centre_of_mass_over_the_rear_foot():
    positions = leaning_clip().positions()[:1]
    mass = centre_of_mass(SKELETON, positions)
    assert abs(float(mass[0, 0])) < 0.01
    assert 0.9 < mass[0, 1] < 1.05
    ahead = np.array([[0.0, 1.0]])
    over = ahead_of_rear_ankle(SKELETON, positions, ahead)[0]
    assert 0.0 < over < 0.12
    apart = positions.copy()
    apart[:, SKELETON.indices(["leftFoot", "leftToes"]), 2] -= 0.3  # a foot behind: the other one is not the rear one
    lighter = 0.3 * (0.0145 + 0.0465 * 0.433)  # its own mass moves too
    assert ahead_of_rear_ankle(SKELETON, apart, ahead)[0] == pytest.approx(over + 0.3 - lighter, abs=1e-4)


def test_the_lean_is_the_trunks_angle_to_the_vertical():
    clip = leaning_clip(30.0)
    positions = clip.positions()
    ahead = np.broadcast_to(np.array([0.0, 1.0]), (len(positions), 2))
    found = lean(SKELETON, positions, ahead)
    assert found[:40].max() - found[0] < 1
    assert found.max() - found[0] == pytest.approx(30, abs=2)
