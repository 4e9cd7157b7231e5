"""Arms that swing: what a network loses that answers the mean of all people who might walk on from here.

Some of them swing their arms a little earlier, some later, some hardly at all, so that their mean is stiff: three
quarters of the way that hands go in the clips at the same speed. Here it is given back: arms and shoulders swing as far
as people's do on average. As with the living idle only the shown frame is touched, never the state that the next step
starts from; nobody who stands, sits or holds a pose is touched at all.
"""

from functools import cache

import torch
from roam_character.matrices import matrix_from_rotvec
from roam_character.tensors.elementary import arctangent
from torch import Tensor

from roam_motion.animation.figure import Figure
from roam_motion.animation.manner import of
from roam_motion.animation.state import Characters, strolling

# Measured on steady walking at 0.7 to 1.0 m/s, clips of the training set beside the network: deviations of 7.5 to 5.5
# degrees of the arm, of 4.3 to 3.6 degrees of the shoulders' turn against the hips.
# The second number is what a deviate of `arms` adds, tuned by hand within the range of captured arm swings.
_ARM, _TRUNK = (0.1, 0.35), (0.2, 0.2)  # shares of the swing that are added
# Walking people carry elbows bent by 38 to 62 degrees and upper arms up to 15 degrees behind hanging; the network has
# elbows at 22 to 27, upper arms 9 to 11 in front (`roam evaluate motion --people`).
_BACK, _BENT = 0.22, 0.40  # [rad] upper arms back, elbows bent farther
_HANGING = 0.295  # [rad] hands swing about this far in front of their shoulders, in the clips and here alike
_MOST = 0.3  # [rad] added at most
_ARMS = ("UpperArm", "LowerArm", "Hand")
_SIDES = ("left", "right")


def walking(characters: Characters) -> Tensor:
    """How much somebody walks [B]: not at all where a goal pose has begun to count, or for the last steps before."""
    return strolling(characters) * (1 - characters.blend).clamp(0.0, 1.0)


@cache
def _joints(figure: Figure) -> tuple[Tensor, Tensor, Tensor]:
    """Turned joints [K], arms [2, 3] (upper arm, lower arm, hand), thighs [2]."""
    indices = figure.skeleton.indices
    arms = [indices([f"{side}{part}" for part in _ARMS]) for side in _SIDES]
    trunk = indices(["upperChest", *(f"{side}Shoulder" for side in _SIDES)])
    return torch.tensor([*trunk, *arms[0], *arms[1]]), torch.tensor(arms), figure.legs[:, 0]


def swinging(figure: Figure, positions: Tensor, orientations: Tensor, share: Tensor, manner: Tensor) -> Tensor:
    """World orientations [B, J, 3, 3] with arms that swing a `share` [B] of what is missing farther.

    `positions` [B, J, 3] are the joints of the body as the step made it [m], `manner` [B, 9] who it is.
    """
    turned, arms, thighs = _joints(figure)
    root = figure.frame(positions)
    local = root.points_in(positions)
    share = share[:, None]
    of_arms, of_trunk = (mean + more * of(manner, "arms")[:, None] for mean, more in (_ARM, _TRUNK))
    across, hips = (local[:, pair[0]] - local[:, pair[1]] for pair in (arms[:, 0], thighs))
    twist = _yaw(across) - _yaw(hips)  # [B]
    yaw = (of_trunk * share * twist[:, None]).clamp(-_MOST, _MOST).expand(-1, len(turned))
    orientations = _turned(orientations, turned, yaw, torch.tensor([0.0, 1.0, 0.0]))
    reach = local[:, arms[:, 2]] - local[:, arms[:, 0]]  # [B, 2, 3]
    ahead = arctangent(reach[..., 2], -reach[..., 1]) - _HANGING
    pitch = (of_arms * share * ahead).clamp(-_MOST, _MOST).repeat_interleave(3, 1)
    left = torch.stack([root.direction[:, 1], torch.zeros_like(share[:, 0]), -root.direction[:, 0]], -1)[:, None]
    carried = torch.tensor([_BACK, _BACK - _BENT, _BACK - _BENT]).repeat(2)  # upper arm, lower arm, hand
    return _turned(orientations, arms.flatten(), share * carried - pitch, left)


def _yaw(across: Tensor) -> Tensor:
    """How far a line from right to left [B, 3] is turned about the vertical [B] [rad]."""
    return arctangent(-across[:, 2], across[:, 0])


def _turned(orientations: Tensor, joints: Tensor, angles: Tensor, axis: Tensor) -> Tensor:
    """World orientations with `joints` [K] turned by `angles` [B, K] about a world `axis` [3] or [B, 1, 3]."""
    turns = matrix_from_rotvec(angles[..., None] * axis)
    return orientations.index_copy(1, joints, turns @ orientations[:, joints])
