"""What l-NSM sees and answers (paper 3.2, Eq. 11-13).

Everything is in the current root frame (hips on the floor, torso's facing) unless said. Deviations from the paper, each
for accuracy after an hour's training instead of a week's:

- the forward pose is answered as *change* from the current pose: an error of a tenth of a deviation is then a
  millimetre;
- joint velocities are finite differences of what was really shown, not a further answer;
- the inverse pose turns each joint relative to the goal pose's own joint orientation, so zero means "at the goal".
"""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from roam_character.matrices import matrix_to_6d
from roam_character.tensors.elementary import arctangent
from torch import Tensor

from roam_motion.actions import STYLES
from roam_motion.animation.figure import CONTACT_JOINTS, Figure, Frame
from roam_motion.animation.prediction import Goals, Prediction, goal_frame
from roam_motion.animation.state import (
    DIRECTION,
    FUTURE,
    KEY_STRIDE,
    KEYS,
    LABELLED,
    PHASE,
    PLACE,
    ROOT,
    STYLE,
    Characters,
    phase_vector,
)

_SCALES = 3  # of the gate's actions: 1, the goal's distance, its angle


@dataclass(frozen=True)
class Inputs:
    """Raw network inputs."""

    frame: Tensor  # [B, F]
    goal: Tensor  # [B, G]
    gating: Tensor  # [B, S]


def frame_widths(joints: int) -> dict[str, int]:
    """Column counts of the blocks that describe the character, in order."""
    return {
        "pose": 12 * joints,  # place, forward axis, up axis, velocity
        "places": 2 * KEYS,
        "directions": 2 * KEYS,
        "styles": len(STYLES) * KEYS,
        "contacts": len(CONTACT_JOINTS),
    }


def goal_widths(joints: int) -> dict[str, int]:
    """Column counts of the blocks that describe the goal, in order."""
    return {
        "pose": 9 * joints,  # place, forward axis, up axis
        "places": 2 * KEYS,
        "directions": 2 * KEYS,
        "action": len(STYLES),
        "settled": 1,
    }


def gating_widths() -> dict[str, int]:
    """Column counts of the gate's blocks, in order: labels times the phase's sine and cosine."""
    return {"styles": KEYS * len(STYLES) * 2, "actions": KEYS * len(STYLES) * _SCALES * 2}


def output_widths(joints: int) -> dict[str, int]:
    """Column counts of the answer's blocks, in order."""
    return {
        "positions": 3 * joints,
        "axes": 6 * joints,
        "inverse_positions": 3 * joints,
        "inverse_axes": 6 * joints,
        "trajectory": (FUTURE + 1) * LABELLED.stop,
        "inverse_trajectory": (FUTURE + 1) * ROOT.stop,
        "contacts": len(CONTACT_JOINTS),
        "phase": FUTURE + 1,
    }


def columns(widths: Mapping[str, int], *names: str) -> Tensor:
    """Whether each column belongs to one of the blocks `names`."""
    return torch.cat([torch.full((width,), name in names) for name, width in widths.items()])


def trajectory_keys(characters: Characters) -> Tensor:
    """The 13 keys from -1 s to +1 s: [B, 13, 9]."""
    return torch.cat([characters.past[:, ::KEY_STRIDE], characters.future], 1)


def encode(characters: Characters, goals: Goals, positions: Tensor, root: Frame) -> Inputs:
    """Inputs for B characters whose joints are at `positions` [B, J, 3] with root frame `root`."""
    keys = trajectory_keys(characters)
    pose = _joints_in(root, positions, characters.orientations, characters.velocities)
    places, directions = _series_in(root, keys[..., PLACE], keys[..., DIRECTION])
    series = [places, directions, keys[..., STYLE]]
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
    phase = phase_vector(keys[..., PHASE.start])  # [B, 13, 2]
    distance = torch.linalg.vector_norm(places, dim=-1).clamp_max(3.0)
    angle = arctangent(directions[..., 0], directions[..., 1])
    # Labels become signs, so that every label is visible at every phase: a label of 0 would hide the phase.
    scales = torch.stack([torch.ones_like(distance), distance, angle], -1)  # [B, 13, 3]
    styles = (2 * keys[..., STYLE] - 1)[..., :, None] * phase[..., None, :]  # [B, 13, 4, 2]
    actions = (2 * action - 1)[:, None, :, None, None] * (scales[..., :, None] * phase[..., None, :])[:, :, None]
    return torch.cat([styles.flatten(1), actions.flatten(1)], 1)


def decode(output: Tensor, characters: Characters, positions: Tensor, root: Frame) -> Prediction:
    """Splits a raw output [B, O] and adds the current pose to the forward change."""
    joints = positions.shape[1]
    columns = output_widths(joints)
    blocks = dict(zip(columns, output.split(list(columns.values()), 1), strict=True))
    batch = output.shape[0]
    pose = _joints_in(root, positions, characters.orientations)
    return Prediction(
        positions=pose[..., :3] + blocks["positions"].reshape(batch, joints, 3),
        axes=pose[..., 3:] + blocks["axes"].reshape(batch, joints, 6),
        inverse_positions=blocks["inverse_positions"].reshape(batch, joints, 3),
        inverse_axes=blocks["inverse_axes"].reshape(batch, joints, 6),
        trajectory=blocks["trajectory"].reshape(batch, FUTURE + 1, LABELLED.stop),
        inverse_trajectory=blocks["inverse_trajectory"].reshape(batch, FUTURE + 1, ROOT.stop),
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
        matrix_to_6d(relative) * goals.active[:, None, None],
        torch.cat([root.points_in(keys[..., PLACE]), root.turn_in(keys[..., DIRECTION]), keys[..., STYLE]], -1),
        torch.cat([goal.points_in(keys[..., PLACE]), goal.turn_in(keys[..., DIRECTION])], -1),
        targets.contacts,
        targets.phase,
    ]
    return torch.cat([b.flatten(1) for b in blocks], 1)


def _turned_axes(root: Frame, orientations: Tensor) -> Tensor:
    return torch.cat([root.turn_in(orientations[..., 2]), root.turn_in(orientations[..., 1])], -1)
