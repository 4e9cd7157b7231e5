"""A motion of our figure on other bodies: feet that stand stay, the end is the body's own goal pose."""

from dataclasses import replace

import numpy as np
import pytest
from roam_character.clip import Clip
from roam_character.pose import Pose
from roam_character.retargeting.onto_body import Performance, ankle_height, onto_body, size_ratio
from roam_character.rotation import quat_from_rotvec
from roam_character.skeleton import Skeleton, Tip, humanoid_skeleton

FIGURE = humanoid_skeleton()
FEET = FIGURE.indices(["leftFoot", "rightFoot"])


def body(scale: float, ankles: float = 1.0) -> Skeleton:
    """The figure `scale` times as large, with ankles as many times as high."""
    offsets = FIGURE.rest_offsets * np.float32(scale)
    lift = ankle_height(FIGURE) * scale * (ankles - 1)
    offsets[0, 1] += lift
    offsets[FIGURE.indices(["leftToes", "rightToes"]), 1] *= ankles
    tips = tuple(Tip(t.name, t.parent, tuple(scale * v for v in t.offset)) for t in FIGURE.tips)
    return replace(FIGURE, rest_offsets=offsets, tips=tips)


def seated(skeleton: Skeleton, ahead: float = 0.0) -> Pose:
    """Hips on a seat, thighs level, shins straight down, feet flat on the floor."""
    shin, drop = (-skeleton.rest_offsets[skeleton.index(f"left{bone}"), 1] for bone in ("Foot", "UpperLeg"))
    height = shin + drop + ankle_height(skeleton)
    turns = np.zeros((22, 3))
    for side in ("left", "right"):
        turns[skeleton.index(f"{side}UpperLeg"), 0] = -np.pi / 2
        turns[skeleton.index(f"{side}LowerLeg"), 0] = np.pi / 2
    return Pose(skeleton, np.array([0.3, height, 0.2 + ahead], np.float32), quat_from_rotvec(turns).astype(np.float32))


def walk_and_sit() -> Performance:
    """Two steps towards the seat (a foot is still while its contact says so), then down onto it."""
    frames = 60
    goal = seated(FIGURE)
    phase = np.linspace(0, 1, frames)
    roots = np.stack([np.full(frames, 0.3), np.full(frames, 0.88), 1.05 - 0.45 * np.minimum(phase / 0.6, 1)], -1)
    sit = np.clip((phase - 0.65) / 0.3, 0, 1)[:, None]
    sit = sit * sit * (3 - 2 * sit)
    roots = roots * (1 - sit) + goal.root_position * sit
    turns = np.broadcast_to(FIGURE.rest_rotations, (frames, 22, 4)).astype(float)
    from roam_character.rotation import quat_slerp

    turns = quat_slerp(turns, np.broadcast_to(goal.rotations.astype(float), turns.shape), sit[..., None])
    contacts = np.ones((frames, 4), bool)
    contacts[8:20, :2] = False
    contacts[22:34, 2:] = False
    clip = Clip(FIGURE, 30.0, roots.astype(np.float32), turns.astype(np.float32))
    ankles = _steps(goal, contacts)
    from roam_character.kinematics import forward_kinematics, limb, reach_with_limb

    rotations = clip.rotations.copy()
    for index, side in enumerate(("left", "right")):
        which = limb(FIGURE, f"{side}Leg")
        posture = forward_kinematics(FIGURE, clip.root_positions, rotations)
        rotations[:, list(which)] = reach_with_limb(FIGURE, which, posture, ankles[index].astype(np.float32))
    return Performance(replace(clip, rotations=rotations), contacts, goal, 0.0)


def _steps(goal: Pose, contacts: np.ndarray) -> list[np.ndarray]:
    found = []
    for index, foot in enumerate(FEET):
        end = goal.positions()[foot]
        start = end + np.array([0.0, 0.0, 0.45])
        planted = contacts[:, 2 * index]
        part = np.cumsum(~planted) / (~planted).sum()
        way = start + part[:, None] * (end - start)
        way[:, 1] += 0.1 * np.sin(np.pi * part) * ~planted
        found.append(way)
    return found


@pytest.mark.parametrize(("scale", "ankles"), [(1.0, 1.0), (0.7, 1.0), (1.15, 1.0), (0.9, 0.2), (0.8, 1.8)])
def test_feet_that_stand_do_not_slide(scale, ankles):
    own = body(scale, ankles)
    performance = walk_and_sit()
    goal = seated(own, ahead=0.06)
    clip, contacts = onto_body(performance, goal)
    places, theirs = clip.positions()[:, FEET], performance.clip.positions()[:, FEET]
    np.testing.assert_array_equal(contacts, performance.contacts)
    for index in range(2):
        planted = performance.contacts[:, 2 * index]
        still = planted[1:] & planted[:-1]
        steps = np.linalg.norm(np.diff(places[:, index], axis=0), axis=-1)[still]
        source = np.linalg.norm(np.diff(theirs[:, index], axis=0), axis=-1)[still]
        assert (steps <= source * scale + 0.001).all(), index
        standing = places[planted][:, index, 1] if planted.any() else np.zeros(1)
        assert standing.min() > ankle_height(own) - 0.01


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.2])
def test_it_ends_in_its_own_goal_pose(scale):
    own = body(scale)
    goal = seated(own, ahead=0.05)
    clip, _ = onto_body(walk_and_sit(), goal)
    np.testing.assert_allclose(clip.positions()[-1], goal.positions(), atol=0.003)


def test_the_way_is_scaled_about_the_goal():
    own = body(0.7)
    performance, goal = walk_and_sit(), seated(own)
    clip, _ = onto_body(performance, goal)
    ratio = size_ratio(own, FIGURE)
    before = performance.clip.root_positions[0] - performance.goal.root_position
    after = clip.root_positions[0] - goal.root_position
    assert after[2] == pytest.approx(ratio * before[2], abs=0.01)
    assert ratio == pytest.approx(0.7, abs=1e-3)


def test_nothing_jumps():
    clip, _ = onto_body(walk_and_sit(), seated(body(0.8), ahead=0.08))
    steps = np.linalg.norm(np.diff(clip.positions(), axis=0), axis=-1)
    assert steps.max() < 0.15  # a foot in the air crosses 0.45 m in 12 frames


def test_a_body_of_other_bones_is_refused():
    from roam_character.skeleton import load_skeleton

    paper = load_skeleton("paper")
    goal = Pose(paper, np.zeros(3, np.float32), paper.rest_rotations)
    with pytest.raises(ValueError, match="bones of the figure"):
        onto_body(walk_and_sit(), goal)


def test_feet_that_hang_at_the_goal_leave_the_floor_on_the_way_down():
    own = body(0.8)
    sitting = seated(own)
    high = Pose(own, sitting.root_position + np.array([0, 0.2, 0], np.float32), sitting.rotations)
    performance = walk_and_sit()
    clip, contacts = onto_body(performance, high)
    feet = clip.positions()[:, FEET, 1]
    near = np.linalg.norm(performance.clip.root_positions - performance.goal.root_position, axis=-1) < 0.4
    assert feet[~near].min() > ankle_height(own) - 0.01
    assert feet[~near & performance.contacts[:, 0] & performance.contacts[:, 2]].max() < ankle_height(own) + 0.01
    np.testing.assert_allclose(clip.positions()[-1], high.positions(), atol=0.003)
    assert not contacts[-1].any()


def test_hips_come_down_where_broad_hips_keep_the_legs_from_the_floor():
    own = body(0.9)
    offsets = own.rest_offsets.copy()
    offsets[own.indices(["leftUpperLeg", "rightUpperLeg"]), 0] *= 2.2
    broad = replace(own, rest_offsets=offsets)
    clip, contacts = onto_body(walk_and_sit(), seated(broad))
    heights = clip.positions()[:, FEET, 1]
    for index in range(2):
        assert heights[contacts[:, 2 * index], index].max() < ankle_height(broad) + 0.01


def test_the_ball_stays_while_the_heel_is_up():
    own = body(0.9)
    offsets = own.rest_offsets.copy()
    offsets[own.indices(["leftToes", "rightToes"]), 2] *= 0.6  # short feet
    short = replace(own, rest_offsets=offsets)
    frames, angle = 40, np.zeros((40, 22, 3))
    lift = 0.6 * np.sin(np.linspace(0, np.pi, frames)) ** 2
    angle[:, FIGURE.index("leftFoot"), 0] = lift
    length = FIGURE.rest_offsets[FIGURE.index("leftToes")]
    roots = np.tile(np.array([0, 0.9, 3.0], np.float32), (frames, 1))
    clip = Clip(FIGURE, 30.0, roots, quat_from_rotvec(angle).astype(np.float32))
    from roam_character.kinematics import forward_kinematics, limb, reach_with_limb
    from roam_character.rotation import quat_inv, quat_mul, quat_rotate

    which = limb(FIGURE, "leftLeg")
    turn = quat_from_rotvec(angle[:, which.end])
    ball = np.array([0.09, 0.0255, 3.125])
    ankle = ball - quat_rotate(turn, np.broadcast_to(length.astype(float), (frames, 3)))
    rotations = clip.rotations.copy()
    for _ in range(3):
        posture = forward_kinematics(FIGURE, roots, rotations)
        rotations[:, list(which)] = reach_with_limb(FIGURE, which, posture, ankle.astype(np.float32))
        above = forward_kinematics(FIGURE, roots, rotations).orientations[:, which.lower]
        rotations[:, which.end] = quat_mul(quat_inv(above), turn.astype(np.float32))
    contacts = np.ones((frames, 4), bool)
    contacts[1:-1, 0] = False
    performance = Performance(replace(clip, rotations=rotations), contacts, seated(FIGURE), 0.0)
    moved, _ = onto_body(performance, seated(short))
    toes = moved.positions()[:, short.index("leftToes")]
    assert np.ptp(toes[:, [0, 2]], axis=0).max() < 0.004
