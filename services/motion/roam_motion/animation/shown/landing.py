"""Coming to rest on a seat: people touch it nearly without moving along it, and then settle back over half a second.

What leads a body into its goal pose (blending.py) arrives when it will, and then fast. Here the shown hips follow the
body's along the floor no faster than people's who are so near to their seat, and catch up once they sit; the state that
the next step starts from knows nothing of it.
"""

import torch
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.actions import LIE
from roam_motion.animation.prediction import Goals
from roam_motion.animation.state import FRAME_RATE, Characters

_ON_SEAT = 0.13  # [m/s] along the floor at most: captured hips touch a seat at 0.06 / 0.13 / 0.22
_HIGHER = 2.0  # [1/s] and so much faster for every metre that they are higher
_ABOVE = 0.02  # [m] over the goal's hips the seat is touched
_EASED = 0.065  # share of what is missing that they catch up in a frame at most
_FREE = 3.0  # [m/s] where nothing holds them back: no goal, a planned way, lying
_FARTHEST = 0.11  # [m] they are left behind at most


def lingering(after: Characters, before: Tensor, goals: Goals) -> Tensor:
    """The next `Characters.linger` [B, 3] of bodies that were shown with their own hips at `before` [B, 3]."""
    height = (after.hips[:, 1] - goals.pose_positions[:, 0, 1] - _ABOVE).clamp_min(0.0)
    held = goals.active * (1 - goals.urgency) * (1 - goals.action[:, LIE.column])
    most = torch.lerp(height.new_full((), _FREE), _ON_SEAT + _HIGHER * height, held) / FRAME_RATE
    level = torch.tensor([1.0, 0.0, 1.0])
    missing = (after.hips - before) * level - after.linger
    far = vector_norm(missing, dim=-1)
    eased = torch.lerp(torch.ones_like(far), far.new_full((), _EASED), held * (height < _ABOVE).float())
    way = torch.maximum(torch.minimum(most, eased * far), far - _FARTHEST)
    return missing * (torch.minimum(way, far) / far.clamp_min(1e-9) - 1)[:, None]
