"""Legs for another seat height: the reference's feet brought to the target's floor, or left hanging from a high
seat."""

import numpy as np
import torch
from roam_character.kinematics import Posture, limb, reach_with_limb
from torch import Tensor

from roam_goalpose.energy.figure import Figure, figure_from_pose

OPEN = 0.8  # thighs: how far ahead of the hip joints ankles hang at least, clear of what holds the seat
HANG = 1.095  # shanks: longest drop from hip joint to ankle, thigh on the seat, shank hanging nearly straight down


def settle_legs(figure: Figure, floor_height: float, *, ankle_height: float | Tensor) -> Figure:
    """The figures with both ankles at `ankle_height` [m] above the floor, no deeper below the hip joints than `HANG`.

    One height for all or one each [B].

    Seats lower than the reference's push the feet forward, so that the knees do not fold against the chest.
    """
    skeleton = figure.skeleton
    rotations = figure.rotations.clone()
    for name in ("leftLeg", "rightLeg"):
        leg = limb(skeleton, name)
        hip, ankle = figure.positions[:, leg.upper], figure.positions[:, leg.end]
        deepest = HANG * float(np.linalg.norm(skeleton.rest_offsets[leg.end]))
        drop = (hip[:, 1] - floor_height - ankle_height).clamp(max=deepest)
        forward = (ankle - hip) * torch.tensor([1.0, 0.0, 1.0])
        reach = forward.norm(dim=-1, keepdim=True)
        before = (hip[:, 1] - ankle[:, 1])[:, None]
        longer = (0.5 * (before - drop[:, None])).clamp(-0.12, 0.12)
        hangs = (drop >= deepest)[:, None]
        least = OPEN * float(np.linalg.norm(skeleton.rest_offsets[leg.lower])) * hangs
        ahead = forward / reach.clamp(min=1e-6) * torch.maximum(reach + longer, least)
        target = torch.stack([hip[:, 0] + ahead[:, 0], hip[:, 1] - drop, hip[:, 2] + ahead[:, 2]], dim=-1)
        bend = forward / reach.clamp(min=1e-6) + torch.tensor([0.0, 0.5, 0.0])
        posture = Posture(figure.positions, figure.orientations)
        turned: Tensor = reach_with_limb(skeleton, leg, posture, target, bend=bend)
        rotations[:, [leg.upper, leg.lower, leg.end]] = turned
    return figure_from_pose(skeleton, figure.root_position, rotations)
