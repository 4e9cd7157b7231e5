"""What the network should answer in a state it drifted into: the data's next frame, approached, not jumped to.

A roll-out leaves the recorded track. Asking for the recorded next frame would teach jumps, asking for the recorded
*change* would teach drift. The expert does what inertial blending does: it adds to the next recorded frame the present
difference, shrunk by a factor per frame, root and pose apart; a planted foot is asked to stay where it is. Every state
is then a supervised example (dataset aggregation), and no gradient has to pass through time.
"""

import torch
from torch import Tensor

from roam_motion.animation.figure import Figure, Frame, orthonormal
from roam_motion.animation.state import FUTURE, KEY_STRIDE, PHASE, STYLE, Characters
from roam_motion.models.lnsm.features import Targets

_POSE_KEEP = 0.90  # share of a pose difference left after a frame: half gone in 0.22 s
_ROOT_KEEP = 0.96  # of a place or heading difference: half gone in 0.57 s
_PHASE_KEEP = 0.95
_HOLD_WITHIN = 0.15  # [m] planted feet nearer than this to their target are asked to stay


def returning(figure: Figure, characters: Characters, positions: Tensor, truth: Characters, ahead: Targets) -> Targets:
    """Targets for `characters` (joints at `positions` [B, J, 3]) whose recorded state is `truth` and goes on as
    `ahead`."""
    own, true_positions = figure.frame(positions), figure.positions(truth.hips, truth.orientations)
    now, then = figure.frame(true_positions), figure.frame(ahead.positions)
    offset = own.origin - now.origin  # [B, 2]
    turn = _angle(own.direction) - _angle(now.direction)
    turn = torch.atan2(turn.sin(), turn.cos())
    to = Frame(then.origin + _ROOT_KEEP * offset, _turned(then.direction, _ROOT_KEEP * turn))
    local = then.points_in(ahead.positions)
    local = local + _POSE_KEEP * (own.points_in(positions) - now.points_in(true_positions))
    joints = _held_feet(figure, characters, positions, truth, to.points_out(local), ahead)
    axes = _axes(then, ahead.orientations)
    axes = axes + _POSE_KEEP * (_axes(own, characters.orientations) - _axes(now, truth.orientations))
    axes = torch.cat([to.turn_out(axes[..., :3]), to.turn_out(axes[..., 3:])], -1)
    return Targets(
        positions=joints,
        orientations=orthonormal(axes),
        trajectory=_trajectory(ahead.trajectory, offset, turn),
        contacts=ahead.contacts,
        phase=_phase(characters, truth, ahead.phase),
    )


def _held_feet(
    figure: Figure, characters: Characters, positions: Tensor, truth: Characters, wanted: Tensor, ahead: Targets
) -> Tensor:
    feet = figure.contacts
    here, there = positions[:, feet], wanted[:, feet]
    near = (here - there)[..., [0, 2]].norm(dim=-1) < _HOLD_WITHIN
    hold = (ahead.contacts > 0.5) & (truth.contacts > 0.5) & near
    kept = torch.stack([here[..., 0], there[..., 1], here[..., 2]], -1)
    wanted = wanted.clone()
    wanted[:, feet] = torch.where(hold[..., None], kept, there)
    return wanted


def _trajectory(keys: Tensor, offset: Tensor, turn: Tensor) -> Tensor:
    frames = 1 + KEY_STRIDE * torch.arange(FUTURE + 1)
    left = _ROOT_KEEP**frames  # [7]
    places = keys[..., :2] + left[:, None] * offset[:, None]
    directions = _turned(keys[..., 2:4], left * turn[:, None])
    return torch.cat([places, directions, keys[..., STYLE]], -1)


def _phase(characters: Characters, truth: Characters, advances: Tensor) -> Tensor:
    behind = truth.past[:, -1, PHASE.start] - characters.past[:, -1, PHASE.start]
    behind = behind - behind.round()
    frames = 1 + KEY_STRIDE * torch.arange(FUTURE + 1)
    return advances + (1 - _PHASE_KEEP**frames) * behind[:, None]


def _axes(frame: Frame, orientations: Tensor) -> Tensor:
    return torch.cat([frame.turn_in(orientations[..., 2]), frame.turn_in(orientations[..., 1])], -1)


def _angle(direction: Tensor) -> Tensor:
    return torch.atan2(direction[..., 0], direction[..., 1])


def _turned(direction: Tensor, angle: Tensor) -> Tensor:
    """Floor directions (x, z) turned by a yaw [rad]."""
    sine, cosine = angle.sin(), angle.cos()
    x, z = direction[..., 0], direction[..., 1]
    return torch.stack([x * cosine + z * sine, z * cosine - x * sine], -1)
