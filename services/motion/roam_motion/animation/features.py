"""What the network sees and answers (paper 3.2, Eq. 11-13; sizes for 22 joints).

Everything is in the current root frame (hips on the floor, torso's facing) unless said. Deviations from the paper, each
for accuracy after an hour's training instead of a week's:

- the forward pose is answered as *change* from the current pose: an error of a tenth of a deviation is then a
  millimetre;
- joint velocities are finite differences of what was really shown, not a further answer;
- the inverse pose turns each joint relative to the goal pose's own joint orientation, so zero means "at the goal";
- goals are 13 root goals (place, direction) with one action, as the controller sets the action hard for all keys.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from roam_motion.animation.figure import Figure, Frame, orthonormal, six
from roam_motion.animation.rows import split_tensor
from roam_motion.animation.state import ACTIONS, FUTURE, KEY_STRIDE, KEYS, Characters, phase_vector
from roam_motion.models.lnsm.network import NetworkConfig


@dataclass
class Goals:
    """Where B characters are to go, in the world."""

    positions: Tensor  # [B, 13, 2] root goals 0..2 s ahead, or the goal pose's root when sitting or lying
    directions: Tensor  # [B, 13, 2]
    action: Tensor  # [B, 4] one-hot idle, walk, sit, lie
    active: Tensor  # [B] 1 while the goal pose counts (sit, lie): the paper's delta
    pose_positions: Tensor  # [B, J, 3] goal pose
    pose_orientations: Tensor  # [B, J, 3, 3]
    urgency: Tensor  # [B] 0..1: how much a late arrival is drawn to the goal pose (see blending); 0 in training

    @staticmethod
    def of(rows: Tensor, joints: int) -> "Goals":
        """A batch from the numbers of every character's goals [B, G]."""
        return Goals(**split_tensor(rows, goal_shapes(joints)))


def goal_shapes(joints: int) -> dict[str, tuple[int, ...]]:
    """The shapes of a single character's goals."""
    return {
        "positions": (KEYS, 2),
        "directions": (KEYS, 2),
        "action": (len(ACTIONS),),
        "active": (),
        "pose_positions": (joints, 3),
        "pose_orientations": (joints, 3, 3),
        "urgency": (),
    }


@dataclass(frozen=True)
class Inputs:
    """Raw network inputs."""

    frame: Tensor  # [B, F]
    goal: Tensor  # [B, G]
    gating: Tensor  # [B, S]


@dataclass(frozen=True)
class Answer:
    """One prediction in raw units; poses in frames as noted."""

    positions: Tensor  # [B, J, 3] next joints in the current root frame [m]
    axes: Tensor  # [B, J, 6] next forward and up axes in the current root frame
    inverse_positions: Tensor  # [B, J, 3] next joints relative to the goal joints, in the goal's facing [m]
    inverse_axes: Tensor  # [B, J, 6] next axes relative to each goal joint's own orientation
    trajectory: Tensor  # [B, 7, 8] root x, z, direction x, z, styles at t+1 + k/6 s
    inverse_trajectory: Tensor  # [B, 7, 4] root x, z, direction x, z in the goal root's frame
    contacts: Tensor  # [B, 4]
    phase: Tensor  # [B, 7] phase advance from now [turns]


def widths(joints: int) -> dict[str, int]:
    """Column counts of the answer's blocks, in order."""
    return {
        "positions": 3 * joints,
        "axes": 6 * joints,
        "inverse_positions": 3 * joints,
        "inverse_axes": 6 * joints,
        "trajectory": (FUTURE + 1) * 8,
        "inverse_trajectory": (FUTURE + 1) * 4,
        "contacts": 4,
        "phase": FUTURE + 1,
    }


def network_config(joints: int, **sizes: int) -> NetworkConfig:
    """Network sizes for a skeleton."""
    return NetworkConfig(
        frame=joints * 12 + KEYS * 8 + 4,
        goal=joints * 9 + KEYS * 4 + 5,
        gating=KEYS * 32,
        output=sum(widths(joints).values()),
        **sizes,
    )


def trajectory_keys(characters: Characters) -> Tensor:
    """The 13 keys from -1 s to +1 s: [B, 13, 9]."""
    return torch.cat([characters.past[:, ::KEY_STRIDE], characters.future], 1)


def goal_frame(figure: Figure, goals: Goals) -> Frame:
    """The frame of inverse outputs: the goal pose's root when active, else the root goal 1 s ahead."""
    pose = figure.frame(goals.pose_positions)
    active = goals.active[:, None] > 0.5
    now = KEYS // 2
    return Frame(
        torch.where(active, pose.origin, goals.positions[:, now]),
        torch.where(active, pose.direction, goals.directions[:, now]),
    )


def encode(figure: Figure, characters: Characters, goals: Goals, positions: Tensor, root: Frame) -> Inputs:
    """Inputs for B characters whose joints are at `positions` [B, J, 3] with root frame `root`."""
    keys = trajectory_keys(characters)
    pose = _joints_in(root, positions, characters.orientations, characters.velocities)
    places, directions = _series_in(root, keys[..., :2], keys[..., 2:4])
    series = [places, directions, keys[..., 4:8]]
    frame = torch.cat([pose.flatten(1), *(part.flatten(1) for part in series), characters.contacts], 1)
    places, directions = _series_in(root, goals.positions, goals.directions)
    goal_pose = _joints_in(root, goals.pose_positions, goals.pose_orientations) * goals.active[:, None, None]
    series = [goal_pose, places, directions]
    goal = torch.cat([*(part.flatten(1) for part in series), goals.action, characters.settled[:, None]], 1)
    return Inputs(frame, goal, _encode_gating(keys, goals.action, places, directions))


def _joints_in(root: Frame, positions: Tensor, orientations: Tensor, *velocities: Tensor) -> Tensor:
    """Places, forward axes, up axes (and velocities) of all joints in the root frame [B, J, 9 or 12]."""
    vectors = [positions - root.place, orientations[..., 2], orientations[..., 1], *velocities]
    return root.turn_in(torch.stack(vectors, 2).flatten(1, 2)).reshape(*positions.shape[:2], -1)


def _series_in(root: Frame, places: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
    """Places and directions of a series of roots [B, 13, 2] in the root frame."""
    turned = root.turn_in(torch.cat([places - root.origin[:, None], directions], 1))
    return turned[:, :KEYS], turned[:, KEYS:]


def _encode_gating(keys: Tensor, action: Tensor, places: Tensor, directions: Tensor) -> Tensor:
    phase = phase_vector(keys[..., 8])  # [B, 13, 2]
    distance = torch.linalg.vector_norm(places, dim=-1).clamp_max(3.0)
    angle = torch.atan2(directions[..., 0], directions[..., 1])
    # Labels become signs, so that every label is visible at every phase (docs/concepts/method.md).
    scales = torch.stack([torch.ones_like(distance), distance, angle], -1)  # [B, 13, 3]
    styles = (2 * keys[..., 4:8] - 1)[..., :, None] * phase[..., None, :]  # [B, 13, 4, 2]
    actions = (2 * action - 1)[:, None, :, None, None] * (scales[..., :, None] * phase[..., None, :])[:, :, None]
    return torch.cat([styles.flatten(1), actions.flatten(1)], 1)


def decode(output: Tensor, characters: Characters, positions: Tensor, root: Frame) -> Answer:
    """Splits a raw output [B, O] and adds the current pose to the forward change."""
    joints = positions.shape[1]
    columns = widths(joints)
    blocks = dict(zip(columns, output.split(list(columns.values()), 1), strict=True))
    batch = output.shape[0]
    pose = _joints_in(root, positions, characters.orientations)
    return Answer(
        positions=pose[..., :3] + blocks["positions"].reshape(batch, joints, 3),
        axes=pose[..., 3:] + blocks["axes"].reshape(batch, joints, 6),
        inverse_positions=blocks["inverse_positions"].reshape(batch, joints, 3),
        inverse_axes=blocks["inverse_axes"].reshape(batch, joints, 6),
        trajectory=blocks["trajectory"].reshape(batch, FUTURE + 1, 8),
        inverse_trajectory=blocks["inverse_trajectory"].reshape(batch, FUTURE + 1, 4),
        contacts=blocks["contacts"],
        phase=blocks["phase"],
    )


@dataclass(frozen=True)
class Targets:
    """The frame that should come next, in the world: what `encode_targets` turns into an output row."""

    positions: Tensor  # [B, J, 3]
    orientations: Tensor  # [B, J, 3, 3]
    trajectory: Tensor  # [B, 7, 8] root x, z, direction, styles
    contacts: Tensor  # [B, 4]
    phase: Tensor  # [B, 7] advances from now


def encode_targets(
    figure: Figure, characters: Characters, goals: Goals, positions: Tensor, root: Frame, targets: Targets
) -> Tensor:
    """The raw output [B, O] that would lead exactly to `targets`: the inverse of `decode`."""
    goal = goal_frame(figure, goals)
    axes = _turned_axes(root, targets.orientations) - _turned_axes(root, characters.orientations)
    relative = goals.pose_orientations.transpose(-1, -2) @ targets.orientations
    keys = targets.trajectory
    blocks = [
        root.points_in(targets.positions) - root.points_in(positions),
        axes,
        goal.turn_in(targets.positions - goals.pose_positions) * goals.active[:, None, None],
        six(relative) * goals.active[:, None, None],
        torch.cat([root.points_in(keys[..., :2]), root.turn_in(keys[..., 2:4]), keys[..., 4:8]], -1),
        torch.cat([goal.points_in(keys[..., :2]), goal.turn_in(keys[..., 2:4])], -1),
        targets.contacts,
        targets.phase,
    ]
    return torch.cat([b.flatten(1) for b in blocks], 1)


def _turned_axes(root: Frame, orientations: Tensor) -> Tensor:
    return torch.cat([root.turn_in(orientations[..., 2]), root.turn_in(orientations[..., 1])], -1)


def world_axes(root: Frame, axes: Tensor) -> Tensor:
    """Axes of the root frame [B, J, 6] -> world axes [B, J, 6]."""
    return torch.cat([root.turn_out(axes[..., :3]), root.turn_out(axes[..., 3:])], -1)


def goal_orientations(goals: Goals, inverse_axes: Tensor) -> Tensor:
    """Inverse axes [B, J, 6] -> world orientations [B, J, 3, 3]."""
    return goals.pose_orientations @ orthonormal(inverse_axes)
