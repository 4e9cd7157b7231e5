"""Foot locking: a planted foot stays where it was put, the leg and, if it must, the pelvis follow.

The published code leaves this inoperative (docs/concepts/method.md, 6). A contact is held on the floor from its first
frame; on release the foot goes over to the network's place within a few frames, never faster than feet move. A planted
foot is held at its ankle, and turned so that its toes stay too; once the heel lifts it is held at its toes. Near the
goal pose, a foot held away from its place there makes one small lifted step, never a slide. Feet are kept above the
floor.
"""

from dataclasses import dataclass
from itertools import pairwise

import torch
from roam_character.kinematics import bent_joint
from roam_character.matrices import matrix_between, unit
from roam_character.tensors.elementary import sine
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.animation.figure import Figure
from roam_motion.animation.state import FRAME_RATE, PLACE, Characters
from roam_motion.animation.stepping import Steps, rise

_ON, _OFF = 0.7, 0.55  # contact probability that starts and ends a lock
_RELEASE, _STEP = 0.25, 0.09  # weight lost per frame: leaving the floor when walking, adjusting step when seated
_OVERREACH = 0.0  # [m] a lock this far beyond the straight leg is let go
_STRAY = 0.15  # [m] a foot that the network wants this far away is let go
_RESTING = 0.6  # blending weight from which the seat carries the body, and both feet may step at once
_MISPLACED = 0.012  # [m] a seated foot farther than this from its goal place takes a step
_LIFT = 0.03  # [m] height of that step
_LEAST_ANKLE, _LEAST_TOES = 0.070, 0.020  # lowest heights over the floor [m]
_FLATTEST = 0.99  # share of a foot's length that it covers of the floor at most
_REACH = 0.998  # share of the leg's length that counts as straight
_FASTEST = (
    0.10,
    0.06,
    0.07,
)  # [m] an ankle moves per frame at most, walking at 0.9 m/s (3 m/s), seated, stepping by rule
# [m] that an ankle may move farther in a frame at a pace of so many [m/s]: runners' (1.9 to 3.5 m/s) move 0.15 to 0.23
_FASTER = ((0.9, 0.0), (1.6, 0.055), (3.0, 0.13))
_YIELD = 0.012  # [m] the pelvis gives way at most per frame; more would sink it into a lunge
_FASTEST_TOES = 0.115  # [m] toes, which the foot's own turning carries further
_STRIDE = 15  # frames over which the speed is measured
_LOW = (0.13, 0.028)  # [m] a lock begins only below this height of ankle and toe joint


@dataclass(frozen=True)
class Planted:
    """Feet for the next frame."""

    hips: Tensor  # [B, 3]
    orientations: Tensor  # [B, J, 3, 3]
    locks: Tensor  # [B, 4, 3]
    weights: Tensor  # [B, 4]


def plant(
    figure: Figure,
    characters: Characters,
    steps: Steps,
    before: Tensor,
    wanted: Tensor,
    orientations: Tensor,
    contacts: Tensor,
    *,
    seated: Tensor,
    floor: Tensor,
    pushed: Tensor,
) -> Planted:
    """Brings the feet to where they belong.

    Args: `steps` that the rule for standing asks for, `before` [B, J, 3] the joints shown last, `wanted` [B, J, 3] the
    blended ones, `orientations` [B, J, 3, 3], `contacts` [B, 4] probabilities, `seated` [B] the bidirectional weight,
    `floor` [B, 4] 1 where they belong on the floor (0 when lying, or hanging from a high seat), `pushed` [B, 2] whether
    furniture is where the shin of a foot would be: such a foot is not held.
    """
    track = wanted[:, figure.contacts]
    last = before[:, figure.contacts]
    within = _within_reach(figure, wanted, orientations, characters.locks) & ~pushed.repeat_interleave(2, -1)
    locks, weights = _locks(characters, steps, last, track, contacts * floor, seated, within)
    eased = weights * weights * (3 - 2 * weights)
    arms = _arms(figure, orientations, track, locks, eased)
    ankle = _ankles(track, locks, weights, eased, arms, seated)
    arms = torch.lerp(arms, track[:, 1::2] - track[:, ::2], steps.share[..., None])
    hurry = _hurry(characters)
    ankle = _not_too_fast(last[:, ::2], ankle, steps, seated, hurry)
    toes = last[:, 1::2]
    arms = _not_too_far(toes, ankle + arms, (_FASTEST_TOES + hurry)[..., None]) - ankle
    arms = unit(arms) * figure.lengths[figure.legs[:, 3], None]
    joints = figure.positions(wanted[:, 0], orientations)
    joints = joints + rise(figure, steps, joints, ankle)[:, None]
    hips, reached = _reach(figure, joints, orientations, ankle)
    return Planted(hips, _feet_turned(figure, reached, arms), locks, weights)


def _within_reach(figure: Figure, wanted: Tensor, orientations: Tensor, locks: Tensor) -> Tensor:
    """Whether each lock [B, 4] can be held by its leg from where the hips are going.

    Otherwise body and foot hold each other up for ever.
    """
    thigh, shin, foot, toes = figure.legs.T
    length = figure.lengths[shin] + figure.lengths[foot] + _OVERREACH
    arm = (orientations[:, foot] @ figure.offsets[toes][..., None])[..., 0]
    ankles = locks.reshape(-1, 2, 2, 3) - torch.stack([torch.zeros_like(arm), arm], 2)  # of both locks of both legs
    return (vector_norm(ankles - wanted[:, thigh, None], dim=-1) < length[:, None]).flatten(1)


def _locks(
    characters: Characters, steps: Steps, last: Tensor, track: Tensor, contacts: Tensor, seated: Tensor, within: Tensor
) -> tuple[Tensor, Tensor]:
    """Next lock positions [B, 4, 3] and weights [B, 4]: 1 held, between letting go, 0 free.

    A lock begins where the joint was shown `last` [B, 4, 3]: from then on it does not move at all.
    """
    weights = characters.lock_weights
    held = weights >= 1
    apart = vector_norm((characters.locks - track)[..., ::2], dim=-1)
    misplaced = held & (seated[:, None] > 0.45) & (apart > _MISPLACED)
    # One foot at a time: the other one (ankle or toes) must not be on its way.
    away = (weights > 0) & (weights < 1)
    other = away[:, [2, 3, 0, 1]].reshape(-1, 2, 2).any(-1).repeat_interleave(2, -1)
    first = misplaced[:, :2].any(-1, keepdim=True) & torch.tensor([False, False, True, True])
    ruled, free = (each.repeat_interleave(2, -1) for each in (steps.stays > 0, steps.share > 0))
    stay = (
        held
        & within
        & ~free
        & (ruled | ((contacts > _OFF) & (apart < _STRAY)))
        & ~(misplaced & (~other & ~first | (seated[:, None] > _RESTING)))
    )
    low = track[..., 1] < torch.tensor([*_LOW, *_LOW])
    landed = (steps.landed > 0).repeat_interleave(2, -1)
    start = ~free & ((weights <= 0) & (contacts > _ON) & low | landed & within)
    rate = torch.where(seated[:, None] > 0.5, _STEP, _RELEASE)
    weights = torch.where(stay | start, torch.ones_like(weights), (weights - rate).clamp_min(0.0))
    weights = torch.where(free, torch.zeros_like(weights), weights)
    return torch.where(start[..., None], last, characters.locks), weights


def _arms(figure: Figure, orientations: Tensor, track: Tensor, locks: Tensor, eased: Tensor) -> Tensor:
    """Ankle-to-toes vectors [B, 2, 3]: from lock to lock where both are held, else raised until the toes are above
    ground."""
    foot, toes = figure.legs[:, 2], figure.legs[:, 3]
    arm = (orientations[:, foot] @ figure.offsets[toes][..., None])[..., 0]
    both = (eased[:, ::2] * eased[:, 1::2])[..., None]
    flat, held = arm[..., ::2], (locks[:, 1::2] - locks[:, ::2])[..., ::2]
    direction = torch.lerp(unit(flat), unit(held), both)
    length = figure.lengths[toes]
    least = _LEAST_TOES - track[:, ::2, 1].clamp_min(_LEAST_ANKLE)
    raised = torch.maximum(arm[..., 1], least)
    apart = torch.minimum(vector_norm(held, dim=-1), _FLATTEST * length)
    raised = torch.lerp(raised, -(length.square() - apart.square()).sqrt(), both[..., 0])
    across = (length.square() - raised.square()).clamp_min(1e-6).sqrt()[..., None] * unit(direction)
    return torch.stack([across[..., 0], raised, across[..., 1]], -1)


def _ankles(track: Tensor, locks: Tensor, weights: Tensor, eased: Tensor, arms: Tensor, seated: Tensor) -> Tensor:
    """Ankle targets [B, 2, 3]."""
    free = track[:, ::2]
    heel_held, heel, toe = weights[:, ::2, None] >= 1, eased[:, ::2, None], eased[:, 1::2, None]
    by_toes = torch.lerp(free, locks[:, 1::2] - arms, toe)
    by_heel = torch.lerp(by_toes, locks[:, ::2], heel)
    toes_held = (weights[:, 1::2, None] >= 1) & ~heel_held
    ankle = torch.where(toes_held, by_toes, by_heel)
    apart = vector_norm((locks - track)[:, ::2], dim=-1)
    arc = sine(torch.pi * weights[:, ::2]) * (apart / 0.05).clamp_max(1.0) * _LIFT * seated[:, None]
    height = (free[..., 1] + arc).clamp_min(_LEAST_ANKLE)
    # Where both are held the foot's pitch is given: the ankle stands over the toes, or they would slide.
    sole = torch.minimum(track[:, 1::2, 1], locks[:, 1::2, 1]).clamp_min(_LEAST_TOES)
    height = torch.lerp(height, sole - arms[..., 1], (heel * toe)[..., 0])
    return torch.stack([ankle[..., 0], height, ankle[..., 2]], -1)


def _hurry(characters: Characters) -> Tensor:
    """What feet may move farther in a frame [B, 1] [m], of somebody who walks fast or runs."""
    way = characters.past[:, -1, PLACE] - characters.past[:, -1 - _STRIDE, PLACE]
    speed = vector_norm(way, dim=-1, keepdim=True) * (FRAME_RATE / _STRIDE)
    more = torch.zeros_like(speed)
    for (slow, less), (fast, most) in pairwise(_FASTER):
        more = more + (most - less) * ((speed - slow) / (fast - slow)).clamp(0.0, 1.0)
    return more


def _not_too_fast(before: Tensor, ankle: Tensor, steps: Steps, seated: Tensor, hurry: Tensor) -> Tensor:
    """Ankle targets no farther from the last shown ones than feet move in a frame."""
    most = torch.where(seated[:, None] > 0.5, hurry.new_full((), _FASTEST[1]), _FASTEST[0] + hurry)
    most = torch.lerp(most.expand(-1, 2), most.new_full((), _FASTEST[2]).expand_as(steps.share), steps.share)
    return _not_too_far(before, ankle, most[..., None])


def _not_too_far(before: Tensor, after: Tensor, most: Tensor | float) -> Tensor:
    """Points `after`, or as far from `before` in their direction as `most` [m] allows."""
    step = after - before
    return before + step * (most / vector_norm(step, dim=-1, keepdim=True).clamp_min(1e-6)).clamp_max(1.0)


def _reach(figure: Figure, joints: Tensor, orientations: Tensor, ankle: Tensor) -> tuple[Tensor, Tensor]:
    """Hips and orientations of a body at `joints` [B, J, 3] with both ankles at `ankle` [B, 2, 3].

    The pelvis gives way when a leg is too short.
    """
    thigh, shin, foot = (figure.legs[:, i] for i in range(3))
    length = figure.lengths[shin] + figure.lengths[foot]
    stretch = ankle - joints[:, thigh]
    reach = vector_norm(stretch, dim=-1, keepdim=True).clamp_min(1e-6)
    excess = (reach - _REACH * length[:, None]).clamp(0.0, _YIELD) * stretch / reach
    size = vector_norm(excess, dim=-1, keepdim=True)
    shift = torch.where(size[:, 0] > size[:, 1], excess[:, 0], excess[:, 1])
    hips, joints = joints[:, 0] + shift, joints + shift[:, None]
    start, knee, end = joints[:, thigh], joints[:, shin], joints[:, foot]
    lengths = figure.lengths[shin, None], figure.lengths[foot, None]
    # To the side that knees bend to now; where the legs are straight, forward.
    bent = bent_joint(start, ankle, lengths, knee - start + 0.02 * orientations[:, thigh][..., 2])
    orientations = orientations.clone()
    orientations[:, thigh] = matrix_between(knee - start, bent - start) @ orientations[:, thigh]
    orientations[:, shin] = matrix_between(end - knee, ankle - bent) @ orientations[:, shin]
    return hips, orientations


def _feet_turned(figure: Figure, orientations: Tensor, arms: Tensor) -> Tensor:
    """Turns feet (and toes with them) so that the toes are at `arms` [B, 2, 3] from the ankles."""
    foot, toes = figure.legs[:, 2], figure.legs[:, 3]
    arm = (orientations[:, foot] @ figure.offsets[toes][..., None])[..., 0]
    turn = matrix_between(arm, arms)
    orientations[:, foot] = turn @ orientations[:, foot]
    orientations[:, toes] = turn @ orientations[:, toes]
    return orientations
