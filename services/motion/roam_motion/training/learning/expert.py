"""What the network should answer in a state it drifted into: the data's next frame, approached, not jumped to.

A roll-out leaves the recorded track. Asking for the recorded next frame would teach jumps, asking for the recorded
*change* would teach drift. The expert does what inertial blending does: it adds to the next recorded frame the present
difference, shrunk by a factor per frame, root and pose apart; a planted foot is asked to stay where it is. Every state
is then a supervised example (dataset aggregation), and no gradient has to pass through time.

A planted foot that is twisted against the body or far from where the recording has it must not stay: recorded feet
beside a body that turned away would teach that crossed legs are normal. Of such feet the worse one is asked to step.
"""

import math

import torch
from roam_character.matrices import matrix_from_6d
from torch import Tensor

from roam_motion.animation.figure import Figure, Frame
from roam_motion.animation.prediction import Goals
from roam_motion.animation.state import DIRECTION, FUTURE, KEY_STRIDE, KEYS, PHASE, PLACE, STYLE, Characters
from roam_motion.models.lnsm.features import Targets

_POSE_KEEP = 0.90  # share of a pose difference left after a frame: half gone in 0.22 s
_ROOT_KEEP = 0.96  # of a place or heading difference: half gone in 0.57 s
_PHASE_KEEP = 0.95
_HOLD_WITHIN = 0.15  # [m] planted feet nearer than this to their target are asked to stay
_TWISTED = math.radians(34)  # a foot turned farther than this from its recorded heading steps
_STEP_KEEP = 0.80  # of a stepping foot's difference: there in a quarter of a second
_STEP_LIFT = 0.05  # [m] height of its ankle over the recorded one, when it is 10 cm away or more
_ON_THE_SPOT = 0.3  # [m] way of a second; feet of who walks on are elsewhere because they are ahead or late
_UPRIGHT = 0.80  # [m] hips higher than this: who sinks or rises keeps his feet


def returning(
    figure: Figure,
    characters: Characters,
    positions: Tensor,
    truth: Characters,
    ahead: Targets,
    goals: Goals | None = None,
) -> Targets:
    """Targets for `characters` (joints at `positions` [B, J, 3]) whose recorded state is `truth` and goes on as
    `ahead`; feet of those who turn on the spot are made to step where they are twisted or far off."""
    own, true_positions = figure.frame(positions), figure.positions(truth.hips, truth.orientations)
    now, then = figure.frame(true_positions), figure.frame(ahead.positions)
    offset = own.origin - now.origin  # [B, 2]
    turn = _angle(own.direction) - _angle(now.direction)
    turn = torch.atan2(turn.sin(), turn.cos())
    to = Frame(then.origin + _ROOT_KEEP * offset, _turned(then.direction, _ROOT_KEEP * turn))
    local = then.points_in(ahead.positions)
    local = local + _POSE_KEEP * (own.points_in(positions) - now.points_in(true_positions))
    axes = _axes(then, ahead.orientations)
    recorded = to.points_out(then.points_in(ahead.positions))[:, figure.contacts]
    steps = _stepping(figure, characters, positions, recorded, to.turn_out(axes[..., :3]), goals)
    steps = steps & (ahead.contacts[:, [2, 0]] > 0.5)  # the other foot stands
    joints = _held_feet(figure, positions, truth, to.points_out(local), ahead, steps, recorded)
    axes = axes + _POSE_KEEP * (_axes(own, characters.orientations) - _axes(now, truth.orientations))
    axes = torch.cat([to.turn_out(axes[..., :3]), to.turn_out(axes[..., 3:])], -1)
    return Targets(
        positions=joints,
        orientations=matrix_from_6d(axes),
        trajectory=_trajectory(ahead.trajectory, offset, turn),
        contacts=ahead.contacts * (1 - steps.repeat_interleave(2, 1).float()),
        phase=_phase(characters, truth, ahead.phase),
    )


def _stepping(
    figure: Figure, characters: Characters, positions: Tensor, recorded: Tensor, axes: Tensor, goals: Goals | None
) -> Tensor:
    """Which feet [B, 2] are to step: the worse one of those twisted against their recorded heading (forward `axes`
    [B, J, 3]) or far from their `recorded` place [B, 4, 3]."""
    feet = figure.contacts[::2]
    own, theirs = characters.orientations[:, feet][..., 2][..., ::2], axes[:, feet][..., ::2]
    twist = _angle(own) - _angle(theirs)
    twist = torch.atan2(twist.sin(), twist.cos()).abs() / _TWISTED
    away = (positions[:, feet] - recorded[:, ::2])[..., ::2].norm(dim=-1) / _HOLD_WITHIN
    need = torch.maximum(twist, away)
    worse = need == need.amax(1, keepdim=True)
    free = positions[:, :1, 1] > _UPRIGHT
    if goals is not None:
        gone = (goals.positions[:, KEYS // 2] - goals.positions[:, 0]).norm(dim=-1)
        free = free & ((goals.active < 0.5) & (gone < _ON_THE_SPOT))[:, None]
    return worse & (need > 1) & free


def _held_feet(
    figure: Figure,
    positions: Tensor,
    truth: Characters,
    wanted: Tensor,
    ahead: Targets,
    steps: Tensor,
    recorded: Tensor,
) -> Tensor:
    """Joints `wanted` [B, J, 3] with planted feet where they are, and stepping ones [B, 2] on their way to the
    `recorded` places [B, 4, 3]."""
    feet = figure.contacts
    step = steps.repeat_interleave(2, 1)
    here, there = positions[:, feet], wanted[:, feet]
    apart = here - recorded
    way = apart[..., ::2].norm(dim=-1)
    over = recorded + _STEP_KEEP * apart
    height = recorded[..., 1] + _STEP_LIFT * (way / 0.10).clamp_max(1.0)
    over = torch.stack([over[..., 0], height, over[..., 2]], -1)
    near = (here - there)[..., [0, 2]].norm(dim=-1) < _HOLD_WITHIN
    hold = (ahead.contacts > 0.5) & (truth.contacts > 0.5) & near & ~step
    kept = torch.stack([here[..., 0], there[..., 1], here[..., 2]], -1)
    wanted = wanted.clone()
    wanted[:, feet] = torch.where(step[..., None], over, torch.where(hold[..., None], kept, there))
    return wanted


def _trajectory(keys: Tensor, offset: Tensor, turn: Tensor) -> Tensor:
    frames = 1 + KEY_STRIDE * torch.arange(FUTURE + 1)
    left = _ROOT_KEEP**frames  # [7]
    places = keys[..., PLACE] + left[:, None] * offset[:, None]
    directions = _turned(keys[..., DIRECTION], left * turn[:, None])
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
