"""A motion of our figure on a body of other proportions, ending in the goal pose that was solved for that body.

Both skeletons stand in the same T-pose, so rotations carry over as they are. The way is scaled by the ratio of leg
lengths about the goal, heights are measured from the ankles' height over the floor, and the legs bend so that the feet
are where the scaled feet are: planted feet stay planted. Towards the goal the pose turns into the body's own goal pose;
the feet take its places in their last swing before they come to rest, so that they do not slide on the floor.
"""

from dataclasses import dataclass

import numpy as np

from roam_character.clip import Clip
from roam_character.kinematics import forward_kinematics, limb, reach_with_limb
from roam_character.pose import Pose
from roam_character.retargeting.proportions import rest_positions
from roam_character.rotation import quat_from_rotvec, quat_identity, quat_inv, quat_mul, quat_rotate, quat_slerp
from roam_character.skeleton import Skeleton

# Distance of the hips from the goal [m on the figure] at which its pose begins to count: standing before a seat the
# hips are 0.42 m or more from it, so all of sitting down is used and none of walking.
_NEAR = 0.40
_THERE = 0.02
_FADE = 0.7  # of a shift from frame to frame in the air: a swing of 12 frames leaves 1 % of it
_HANGS = 0.04  # of the leg: a foot higher above where it stands in the goal pose hangs (goal poses stand within 3 cm)
_SIDES = ("left", "right")


@dataclass(frozen=True, eq=False)
class Performance:
    """A motion of the figure that was animated, and what it was going to."""

    clip: Clip
    contacts: np.ndarray  # [T, 4] leftFoot, leftToes, rightFoot, rightToes
    goal: Pose  # of the same skeleton
    floor: float  # [m]


def leg_length(skeleton: Skeleton) -> float:
    """Thigh and shin [m], mean of both sides."""
    joints = skeleton.indices([f"{side}{bone}" for side in _SIDES for bone in ("LowerLeg", "Foot")])
    return float(np.linalg.norm(skeleton.rest_offsets[joints], axis=-1).sum() / 2)


def ankle_height(skeleton: Skeleton) -> float:
    """Of the ankles above the soles in the T-pose [m]."""
    feet = skeleton.indices(["leftFoot", "rightFoot"])
    return float(rest_positions(skeleton)[feet, 1].mean())


def size_ratio(skeleton: Skeleton, figure: Skeleton) -> float:
    """How much longer the legs of `skeleton` are than the figure's."""
    return leg_length(skeleton) / leg_length(figure)


def onto_body(performance: Performance, goal: Pose) -> tuple[Clip, np.ndarray]:
    """The motion on the skeleton of `goal`, ending in that pose, and its contacts [T, 4]: the same frames.

    Feet that hang in the body's goal pose lose their contact on the way down. ValueError when the two skeletons are
    not made of the same bones in a T-pose.
    """
    clip, body = performance.clip, goal.skeleton
    if body.joint_names != clip.skeleton.joint_names or body.parents != clip.skeleton.parents:
        raise ValueError("the body's skeleton must have the bones of the figure that was animated")
    carried = _Carried(performance, goal)
    nearness = _nearness(performance)
    at_goal = carried.pose(performance.goal.root_position[None], performance.goal.rotations[None])
    away = quat_mul(goal.rotations, quat_inv(at_goal.rotations[0]))
    rotations = quat_mul(_part(away, nearness), clip.rotations)
    roots = carried.roots(clip.root_positions, clip.rotations)
    roots = roots + nearness[:, None] * (goal.root_position - at_goal.root_positions[0])
    feet = _Feet(performance, goal, carried, nearness)
    roots = _within_reach(body, roots, rotations, feet.targets, nearness)
    rotations = _plant(performance.floor, body, feet, roots, rotations)
    moved = Clip(body, clip.frame_rate, roots.astype(np.float32), rotations.astype(np.float32))
    return moved, performance.contacts & ~np.repeat(feet.lifted, 2, axis=1)


class _Carried:
    """Places of the figure brought to the body: scaled about the goal, heights from the ankles' over the floor."""

    def __init__(self, performance: Performance, goal: Pose) -> None:
        self.figure, self.body = performance.clip.skeleton, goal.skeleton
        self.scale = size_ratio(self.body, self.figure)
        self.floor = performance.floor
        self.lifts = ankle_height(self.figure), ankle_height(self.body)
        self.anchors = performance.goal.root_position * [1, 0, 1], goal.root_position * [1, 0, 1]

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points of the figure [..., 3] where the body has them."""
        heights = (points[..., 1:2] - self.floor - self.lifts[0]) * self.scale + self.floor + self.lifts[1]
        flat = (points - self.anchors[0]) * self.scale + self.anchors[1]
        return np.concatenate([flat[..., :1], heights, flat[..., 2:]], axis=-1)

    def roots(self, roots: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """The body's hips [T, 3]: the middle of its hip joints is where the figure's is."""
        legs = [s.rest_offsets[s.indices(["leftUpperLeg", "rightUpperLeg"])].mean(axis=0)
                for s in (self.figure, self.body)]  # fmt: skip
        turns = rotations[:, 0]
        middle = roots + quat_rotate(turns, np.broadcast_to(legs[0], roots.shape))
        return np.asarray(self.place(middle) - quat_rotate(turns, np.broadcast_to(legs[1], roots.shape)))

    def ankles(self, roots: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Where the body's ankles go [T, 2, 3]."""
        feet = self.figure.indices(["leftFoot", "rightFoot"])
        posture = forward_kinematics(self.figure, roots, rotations)
        return self.place(np.asarray(posture.positions)[:, feet])

    def pose(self, roots: np.ndarray, rotations: np.ndarray) -> Clip:
        """The body with legs reaching for those ankles."""
        own, turns = self.roots(roots, rotations).astype(np.float32), rotations.copy()
        ankles = self.ankles(roots, rotations)
        for index, side in enumerate(_SIDES):
            turns = _reached(self.body, own, turns, side, ankles[:, index])
        return Clip(self.body, 30.0, own, turns)


def _reached(body: Skeleton, roots: np.ndarray, rotations: np.ndarray, side: str, ankle: np.ndarray) -> np.ndarray:
    """Local rotations with one leg reaching for its ankle. Twice: near a straight leg one step is millimetres off."""
    which, turns = limb(body, f"{side}Leg"), rotations.copy()
    for _ in range(2):
        posture = forward_kinematics(body, roots, turns)
        ahead = quat_rotate(posture.orientations[:, which.lower], np.broadcast_to([0.0, 0.0, 1.0], ankle.shape))
        turns[:, list(which)] = reach_with_limb(body, which, posture, ankle, bend=ahead)
    return turns


def _nearness(performance: Performance) -> np.ndarray:
    """How much of the goal pose counts in each frame [T], 0 to 1."""
    away = np.linalg.norm(performance.clip.root_positions - performance.goal.root_position, axis=-1)
    part = np.clip((_NEAR - away) / (_NEAR - _THERE), 0.0, 1.0)
    return np.asarray(part * part * (3 - 2 * part))


def _part(turn: np.ndarray, amount: np.ndarray) -> np.ndarray:
    """Rotations [J, 4] taken in part [T] -> [T, J, 4]."""
    full = np.broadcast_to(turn, (len(amount), *turn.shape))
    return np.asarray(quat_slerp(quat_identity(full, full.shape[:-1]), full, amount[:, None, None]))


class _Feet:
    """Where the feet go: the carried places, then those of the goal pose, which they take in their last swing."""

    def __init__(self, performance: Performance, goal: Pose, carried: _Carried, nearness: np.ndarray) -> None:
        clip, body = performance.clip, goal.skeleton
        ankles = carried.ankles(clip.root_positions, clip.rotations)
        there = carried.ankles(performance.goal.root_position[None], performance.goal.rotations[None])[0]
        figure = np.asarray(clip.posture().orientations)
        resting = np.asarray(performance.goal.posture().orientations)
        own = goal.posture()
        targets, turns, lifted = [], [], []
        for index, side in enumerate(_SIDES):
            foot = body.index(f"{side}Foot")
            standing = ankle_height(body) + performance.floor
            hangs = bool(own.positions[foot, 1] > standing + _HANGS * leg_length(body))
            planted = performance.contacts[:, 2 * index] | performance.contacts[:, 2 * index + 1]
            taken = nearness if hangs else _taken(planted, nearness)
            targets.append(ankles[:, index] + taken[:, None] * (own.positions[foot] - there[index]))
            turn = quat_mul(own.orientations[foot], quat_inv(resting[foot]))
            turns.append(quat_mul(_part(turn[None], taken)[:, 0], figure[:, foot]))
            lifted.append((taken > 0.02) if hangs else np.zeros(len(clip), bool))
        self.turns = np.stack(turns, axis=1)  # [T, 2, 4] world orientations
        self.lifted = np.stack(lifted, axis=1)  # [T, 2] off the floor though the figure's foot stands
        contacts = performance.contacts & ~np.repeat(self.lifted, 2, axis=1)
        for index, side in enumerate(_SIDES):
            ball = quat_rotate(
                turns[index], np.broadcast_to(body.rest_offsets[body.index(f"{side}Toes")], (len(clip), 3))
            )
            shift = _ball_shift(targets[index], ball, *contacts[:, 2 * index : 2 * index + 2].T)
            targets[index] = targets[index] + shift * (1 - nearness)[:, None]
        self.targets = np.stack(targets, axis=1)  # [T, 2, 3] of the ankles


def _ball_shift(ankles: np.ndarray, balls: np.ndarray, ankle_down: np.ndarray, ball_down: np.ndarray) -> np.ndarray:
    """What ankles [T, 3] must be moved by so that the ball stays where it is while the heel is up.

    `balls` [T, 3] are from the ankle to the ball. A foot of other length than the figure's would slide on its ball. The
    shift fades in the air.
    """
    shift = np.zeros_like(ankles)
    anchor: np.ndarray | None = None
    for frame in range(1, len(ankles)):
        before = shift[frame - 1]
        if not ball_down[frame]:
            anchor = None
            shift[frame] = before if ankle_down[frame] else before * _FADE
        elif ankle_down[frame] or anchor is None:
            shift[frame] = before if ankle_down[frame] else before * _FADE
            anchor = ankles[frame] + balls[frame] + shift[frame]
        else:
            shift[frame] = anchor - balls[frame] - ankles[frame]
    return shift


def _within_reach(
    body: Skeleton, roots: np.ndarray, rotations: np.ndarray, ankles: np.ndarray, nearness: np.ndarray
) -> np.ndarray:
    """Hips [T, 3] lowered where a leg could not reach its ankle: bodies with broader hips or other ankles need it."""
    positions = np.asarray(forward_kinematics(body, roots, rotations).positions)
    longest = 0.998 * leg_length(body)
    drops = np.zeros(len(roots))
    for index, side in enumerate(_SIDES):
        hip = positions[:, body.index(f"{side}UpperLeg")]
        flat = np.linalg.norm((hip - ankles[:, index])[:, [0, 2]], axis=-1)
        highest = ankles[:, index, 1] + np.sqrt(np.maximum(longest**2 - flat**2, 0.0))
        drops = np.maximum(drops, hip[:, 1] - highest)
    # Held over a fifth of a second and smoothed over as much: the hips sway, they do not jerk.
    width = min(7, len(drops))
    padded = np.pad(np.maximum(drops, 0.0), width // 2, mode="edge")
    held = np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=-1)[: len(drops)]
    padded = np.pad(held, width // 2, mode="edge")
    smooth = np.lib.stride_tricks.sliding_window_view(padded, width).mean(axis=-1)[: len(drops)]
    return np.asarray(roots - (smooth * (1 - nearness))[:, None] * [0.0, 1.0, 0.0])


def _plant(floor: float, body: Skeleton, feet: _Feet, roots: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Legs that reach for the feet's places, feet turned as they should be."""
    for index, side in enumerate(_SIDES):
        foot = body.index(f"{side}Foot")
        rotations = _reached(body, roots, rotations, side, feet.targets[:, index])
        posture = forward_kinematics(body, roots, rotations)
        above = posture.orientations[:, body.parents[foot]]
        rotations[:, foot] = quat_mul(quat_inv(above), feet.turns[:, index])
        rotations[:, foot] = _toes_up(body, roots, rotations, side, floor)
    return rotations


def _taken(planted: np.ndarray, nearness: np.ndarray) -> np.ndarray:
    """How much of the goal's place a foot has taken in each frame [T]: changes only while the foot is in the air.

    Where it never leaves the floor, or hangs in the air at the goal, it goes along with the rest of the body.
    """
    near = np.flatnonzero(nearness > 0.999)
    if len(near) == 0 or not planted[near].any():
        return nearness
    first, last = int(near[0]), int(near[-1])
    taken = np.zeros(len(planted))
    taken[first : last + 1] = 1.0
    before, after = _swing(planted, first, -1), _swing(planted, last, 1)
    if before is None:
        taken[:first] = nearness[:first]
    else:
        taken[before[1] : first] = 1.0
        taken[before[0] : before[1]] = _ramp(before[1] - before[0])
    if after is None:
        taken[last + 1 :] = nearness[last + 1 :]
    else:
        taken[last + 1 : after[0]] = 1.0
        taken[after[0] : after[1]] = 1 - _ramp(after[1] - after[0])
    return taken


def _swing(planted: np.ndarray, start: int, step: int) -> tuple[int, int] | None:
    """The stretch in the air nearest before (step -1) or after (1) a frame, of at least three frames: [begin, end)."""
    frame = start
    while 0 <= frame < len(planted):
        if not planted[frame]:
            other = frame
            while 0 <= other < len(planted) and not planted[other]:
                other += step
            begin, end = (other + 1, frame + 1) if step < 0 else (frame, other)
            if end - begin >= 3:
                return begin, end
            frame = other
        else:
            frame += step
    return None


def _ramp(count: int) -> np.ndarray:
    part = (np.arange(count) + 1) / (count + 1)
    return np.asarray(part * part * (3 - 2 * part))


def _toes_up(body: Skeleton, roots: np.ndarray, rotations: np.ndarray, side: str, floor: float) -> np.ndarray:
    """Local rotations [T, 4] of a foot that is tilted up where its ball would sink below where it stands at rest."""
    foot, toes = body.index(f"{side}Foot"), body.index(f"{side}Toes")
    least = float(rest_positions(body)[toes, 1]) + floor
    posture = forward_kinematics(body, roots, rotations)
    arm = quat_rotate(posture.orientations[:, foot], np.broadcast_to(body.rest_offsets[toes], (len(roots), 3)))
    length = float(np.linalg.norm(body.rest_offsets[toes]))
    now = np.arcsin(np.clip(arm[:, 1] / length, -1, 1))
    wanted = np.arcsin(np.clip((least - posture.positions[:, foot, 1]) / length, -1, 1))
    rise = np.clip(wanted - now, 0.0, np.pi / 2)
    flat = arm * [1.0, 0.0, 1.0]
    axis = np.cross(flat, [0.0, 1.0, 0.0])
    axis = axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-9)
    turned = quat_mul(quat_from_rotvec(axis * rise[:, None]), posture.orientations[:, foot])
    return np.asarray(quat_mul(quat_inv(posture.orientations[:, body.parents[foot]]), turned))
