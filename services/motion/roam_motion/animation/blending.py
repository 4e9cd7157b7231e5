"""Bidirectional blending (paper 3.2, supplement C): the forward answer meets the goal-centric one near the goal.

The paper prints an additive blend and a reciprocal in the exponent; both are slips (docs/concepts/method.md, 7). Here
lambda = action value x (1 - 1 / (1 + exp(-20 (d - 0.25)))) interpolates positions *and* rotations: 0.993 at the goal,
0.5 at 25 cm, 0.007 at 50 cm mean joint distance.
"""

from dataclasses import dataclass

import torch
from roam_character.matrices import matrix_from_6d, matrix_to_6d, unit
from roam_character.tensors.elementary import arccosine, exponential, sigmoid
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.animation.figure import Figure, Frame
from roam_motion.animation.prediction import Goals, Prediction, goal_orientations, world_axes
from roam_motion.animation.state import FUTURE, Characters

_STEEPNESS = 20.0  # [1/m]
_HALFWAY = 0.25  # [m]
_STRAY, _TWIST = 0.02, 0.1  # [m], [1] a joint may stray farther from its goal than it is: lifted feet, swinging arms
_RISE, _FALL = 0.06, 0.15  # most that the weight may change in a frame: no pop when modes switch
_SETTLE_WITHIN = 0.15  # [m] mean joint distance from which the held pose is drawn onto the goal
_SETTLE_RISE, _SETTLE_FALL = 1 / 40, 1 / 10  # per frame
_FASTEST_TURN = 0.20, 0.14  # [rad] a bone turns per frame at most: walking, and while a goal pose is active
_FASTEST_LEG = 0.35  # [rad] legs, walking
_LIVING = 0.1  # share of the network's own motion that stays when settled


@dataclass(frozen=True)
class Blending:
    """Which parts of the blend work; evaluations switch them off to see what they are worth."""

    inverse: bool = True  # the paper's bidirectional blending
    settling: bool = True  # a pose that is nearly taken, or long overdue, is drawn onto the goal pose


WHOLE = Blending()


def distance_weight(distance: Tensor) -> Tensor:
    """Sigmoid weight of the mean joint distance to the goal pose [m]. [...] -> [...]."""
    return 1 - sigmoid(_STEEPNESS * (distance - _HALFWAY))


def limited(value: Tensor, target: Tensor, rise: float, fall: float) -> Tensor:
    """`value` moved towards `target` by at most `rise` up or `fall` down."""
    return value + (target - value).clamp(-fall, rise)


def blend_weights(
    distance: Tensor, action: Tensor, blend: Tensor, settled: Tensor, urgency: Tensor, parts: Blending = WHOLE
) -> tuple[Tensor, Tensor]:
    """Next bidirectional weight and next settledness, both rate limited. All [B].

    `urgency` is for the few that are not there when a sit-down should long be over: it raises the weight by itself.
    """
    blend = limited(
        blend, torch.maximum(float(parts.inverse) * action * distance_weight(distance), urgency), _RISE, _FALL
    )
    near = ((action > 0.5) & (distance < _SETTLE_WITHIN)).float() * float(parts.settling)
    return blend, limited(settled, near, _SETTLE_RISE, _SETTLE_FALL)


def blend_pose(
    answer: Prediction,
    characters: Characters,
    before: Tensor,
    root: Frame,
    goals: Goals,
    facing: Frame,
    weight: Tensor,
    settled: Tensor,
) -> tuple[Tensor, Tensor]:
    """Blended joint positions [B, J, 3] and orientations [B, J, 3, 3] in the world.

    `before` [B, J, 3] the joints shown last, `facing` the goal's frame; `weight` and `settled` [B]. Settled, the
    inverse answer keeps a tenth of its distance to the goal, so that the held pose ends in the goal whatever the
    network's own error there. Nor does it lead away from the goal once it decides: a leg that it waves would never
    come to rest.
    """
    own = (1 - (1 - _LIVING) * settled)[:, None, None] * (1 - goals.urgency)[:, None, None]
    rest = answer.inverse_axes.new_tensor([0.0, 0.0, 1.0, 0.0, 1.0, 0.0])
    w = weight[:, None, None]
    away = answer.inverse_positions * _homing(answer.inverse_positions, before - goals.pose_positions, w, _STRAY)
    here = matrix_to_6d(goals.pose_orientations.transpose(-1, -2) @ characters.orientations)
    turn = answer.inverse_axes - rest
    turn = turn * _homing(turn, here - rest, w, _TWIST)
    inverse = goals.pose_positions + facing.turn_out(away * own)
    turned = matrix_to_6d(goal_orientations(goals, rest + turn * own))
    positions = torch.lerp(root.points_out(answer.positions), inverse, w)
    axes = torch.lerp(world_axes(root, answer.axes), turned, w)
    return positions, matrix_from_6d(axes)


def _homing(answered: Tensor, present: Tensor, weight: Tensor, slack: float) -> Tensor:
    """Factor [B, J, 1] that keeps answered offsets from the goal no larger than the `present` ones and some `slack`."""
    size, most = vector_norm(answered, dim=-1, keepdim=True), vector_norm(present, dim=-1, keepdim=True) + slack
    return 1 - weight * (1 - (most / size.clamp_min(1e-6)).clamp_max(1.0))


def limit_turns(figure: Figure, before: Tensor, wanted: Tensor, active: Tensor, hurry: float = 1.0) -> Tensor:
    """World orientations [B, J, 3, 3] no farther from the last shown ones than bones turn in a frame.

    Forward and inverse answers may differ by half a turn in a hand; interpolating those would snap. `active` [B];
    `hurry` times as fast as bones turn by themselves.
    """
    cosine = ((before * wanted).sum((-1, -2)) - 1) / 2  # from the trace of the relative rotation
    angle = arccosine(cosine.clamp(-1 + 1e-6, 1 - 1e-6))
    walking = torch.full_like(angle[0], _FASTEST_TURN[0])
    walking[figure.legs.flatten()] = _FASTEST_LEG
    most = hurry * torch.where(active[:, None] > 0.5, _FASTEST_TURN[1], walking)
    share = (most / angle).clamp_max(1.0)[..., None]
    return torch.where(
        share[..., None] < 1, matrix_from_6d(torch.lerp(matrix_to_6d(before), matrix_to_6d(wanted), share)), wanted
    )


def blend_trajectory(answer: Prediction, root: Frame, facing: Frame, goals: Goals) -> Tensor:
    """Future keys in the world [B, 6, 4] (x, z, direction), weight (k/7)^(D^2) with D the distance to the goal [m]."""
    ahead, back = answer.trajectory[:, 1:], answer.inverse_trajectory[:, 1:]
    places, directions = root.points_out(ahead[..., :2]), root.turn_out(ahead[..., 2:4])
    goal_places, goal_directions = facing.points_out(back[..., :2]), facing.turn_out(back[..., 2:4])
    k = torch.arange(1, FUTURE + 1, dtype=places.dtype)
    apart = (places - facing.origin[:, None]).norm(dim=-1)
    weight = exponential(apart.square() * (k / (FUTURE + 1)).log())[..., None]
    directions = unit(torch.lerp(directions, goal_directions, weight))
    return torch.cat([torch.lerp(places, goal_places, weight), directions], -1)
