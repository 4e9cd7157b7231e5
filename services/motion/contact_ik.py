"""Foot locking: a planted foot stays where it was put, the leg and, if it must, the pelvis follow.

The published code leaves this inoperative (METHOD-NOTES, decision 6). A contact is held on the floor from its first
frame; on release the foot goes over to the network's place within a few frames. Near the goal pose, a foot held away from
its place there makes one small lifted step, never a slide. Ankles and toes are kept above the floor.
"""

import torch
from character.kinematics import two_bone_ik
from character.rotation import quat_between, quat_to_matrix
from torch import Tensor

from motion.figure import Figure
from motion.state import Characters

_ON, _OFF = 0.55, 0.35  # contact probability that starts and ends a lock
_RELEASE, _STEP = 0.25, 0.09  # weight lost per frame: leaving the floor when walking, adjusting step when seated
_STRAY = 0.20  # [m] a foot that the network wants this far away is let go
_MISPLACED = 0.012  # [m] a seated foot farther than this from its goal place takes a step
_LIFT = 0.03  # [m] height of that step
_LEAST_ANKLE, _LEAST_TOES = 0.070, 0.020  # lowest heights over the floor [m]
_REACH = 0.998  # share of the leg's length that counts as straight


def plant(
    figure: Figure,
    characters: Characters,
    wanted: Tensor,
    orientations: Tensor,
    contacts: Tensor,
    *,
    seated: Tensor,
    floor: Tensor,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Feet for the next frame.

    Args: `wanted` [B, J, 3] the blended joint positions, `orientations` [B, J, 3, 3], `contacts` [B, 4] probabilities,
    `seated` [B] the bidirectional weight, `floor` [B] 1 where feet belong on the floor (0 when lying).
    Returns hips [B, 3], orientations, lock positions [B, 4, 3], lock weights [B, 4].
    """
    track = wanted[:, figure.contacts]
    locks, weights = _locks(characters, track, contacts * floor[:, None], seated)
    eased = weights * weights * (3 - 2 * weights)
    pull = eased[..., None] * (locks - track)
    ankle = track[:, [0, 2]] + pull[:, [0, 2]] + (1 - eased[:, [0, 2], None]) * pull[:, [1, 3]]
    apart = (locks - track)[:, [0, 2]].norm(dim=-1)
    arc = torch.sin(torch.pi * weights[:, [0, 2]]) * (apart / 0.05).clamp_max(1.0) * _LIFT * seated[:, None]
    height = torch.maximum(track[:, [0, 2], 1] + arc, torch.full_like(arc, _LEAST_ANKLE))
    ankle = torch.stack([ankle[..., 0], height, ankle[..., 2]], -1)
    hips, orientations = _reach(figure, wanted[:, 0], orientations, ankle)
    return hips, _toes_up(figure, orientations, ankle), locks, weights


def _locks(characters: Characters, track: Tensor, contacts: Tensor, seated: Tensor) -> tuple[Tensor, Tensor]:
    """Next lock positions [B, 4, 3] and weights [B, 4]: 1 held, between letting go, 0 free."""
    weights = characters.lock_weights
    held = weights >= 1
    apart = (characters.locks - track)[..., [0, 2]].norm(dim=-1)
    misplaced = held & (seated[:, None] > 0.8) & (apart > _MISPLACED)
    # One foot at a time: the other one (ankle or toes) must not be on its way.
    away = (weights > 0) & (weights < 1)
    other = away[:, [2, 3, 0, 1]].reshape(-1, 2, 2).any(-1).repeat_interleave(2, -1)
    first = misplaced[:, :2].any(-1, keepdim=True) & torch.tensor([False, False, True, True])
    stay = held & (contacts > _OFF) & (apart < _STRAY) & ~(misplaced & ~other & ~first)
    start = (weights <= 0) & (contacts > _ON)
    rate = torch.where(seated[:, None] > 0.5, _STEP, _RELEASE)
    weights = torch.where(stay | start, torch.ones_like(weights), (weights - rate).clamp_min(0.0))
    return torch.where(start[..., None], track, characters.locks), weights


def _reach(figure: Figure, hips: Tensor, orientations: Tensor, ankle: Tensor) -> tuple[Tensor, Tensor]:
    """Hips and orientations with both ankles at `ankle` [B, 2, 3]; the pelvis gives way when a leg is too short."""
    joints = figure.positions(hips, orientations)
    thigh, shin, foot = (figure.legs[:, i] for i in range(3))
    length = figure.offsets[shin].norm(dim=-1) + figure.offsets[foot].norm(dim=-1)
    stretch = ankle - joints[:, thigh]
    reach = stretch.norm(dim=-1, keepdim=True).clamp_min(1e-6)
    excess = (reach - _REACH * length[:, None]).clamp(0.0, 0.05) * stretch / reach
    shift = torch.where(excess[:, 0].norm(dim=-1, keepdim=True) > excess[:, 1].norm(dim=-1, keepdim=True), excess[:, 0], excess[:, 1])
    hips, joints = hips + shift, joints + shift[:, None]
    bend = orientations[:, thigh][..., 2]
    upper, lower = two_bone_ik(joints[:, thigh], joints[:, shin], joints[:, foot], ankle, bend=bend)
    orientations = orientations.clone()
    orientations[:, thigh] = quat_to_matrix(upper) @ orientations[:, thigh]
    orientations[:, shin] = quat_to_matrix(lower) @ orientations[:, shin]
    return hips, orientations


def _toes_up(figure: Figure, orientations: Tensor, ankle: Tensor) -> Tensor:
    """Turns each foot up until its toe joint is above the floor."""
    foot, toes = figure.legs[:, 2], figure.legs[:, 3]
    arm = (orientations[:, foot] @ figure.offsets[toes][..., None])[..., 0]  # [B, 2, 3]
    least = _LEAST_TOES - ankle[..., 1]
    raised = torch.maximum(arm[..., 1], least)
    flat = arm[..., [0, 2]]
    length = figure.offsets[toes].norm(dim=-1)
    across = (length.square() - raised.square()).clamp_min(1e-6).sqrt() / flat.norm(dim=-1).clamp_min(1e-6)
    target = torch.stack([flat[..., 0] * across, raised, flat[..., 1] * across], -1)
    turn = quat_to_matrix(quat_between(arm, target))
    orientations[:, foot] = turn @ orientations[:, foot]
    orientations[:, toes] = turn @ orientations[:, toes]
    return orientations
