"""How a body goes along with its steps: what a network loses that answers the mean of all people who walk like this.

Means of people cancel where some are a little earlier and some later: pelvis and trunk sway, turn and nod less than
anybody's. Here a captured walker's missing part is given back, by the gait's phase. Only the shown frame is touched,
and the feet stay where they are.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from roam_motion.animation.figure import Figure
from roam_motion.animation.manner import of
from roam_motion.animation.proportions import size
from roam_motion.animation.state import PHASE, Characters

# Harmonics of captured straight walking at 0.7 to 1.4 m/s (39 persons) less those of the network at 0.9 and 1.2 m/s:
# size, and where in the cycle it is greatest [rad]. The cycle begins where the left ankle is farthest ahead.
_STRIKE = 0.26  # [rad] after the label's own beginning, the onset of the left foot's contact
_ASIDE = 0.019, -1.97  # [m] hips, to the left
_AHEAD = 0.0068, -1.80  # [m] hips: faster as a foot strikes, slower over it (twice a cycle)
_UP = 0.0015, math.pi  # [m] hips, highest over the standing foot (twice a cycle)
_TURN = 0.038, 2.80  # [rad] pelvis, to the left
_NOD = 0.0115, 0.9  # [rad] trunk (twice a cycle)
_HEAD = 0.017, 1.66  # [rad] head, beyond the trunk's (twice a cycle)
# What a deviate changes: the share of the pelvis' turn, and the hips' height [m] (3 to 4 degrees of the knees); tuned
# on the spread of persons' gaits.
_TURNS, _LOWER = 1.1, 0.006
_SLACK = 0.985  # share of a leg's length to which hips may rise
_TALLER = 1.0, 0.010  # share of that way which they do, and [m] at most: networks walk with bent knees
_CLEAR = 0.008  # [m] that a foot swings higher
_DRIFT = 0.012, 0.03  # [m] hips aside, [rad] lean of the trunk, that wander from stride to stride


@dataclass(frozen=True)
class Sway:
    """What is added to B walking bodies, in their own frames (left, up, ahead)."""

    hips: Tensor  # [B, 3] [m]
    pelvis: Tensor  # [B] turn to the left [rad]
    trunk: Tensor  # [B] nod forward [rad]
    head: Tensor  # [B] the head's beyond it [rad]
    feet: Tensor  # [B, 2, 3] [m]


def sway(figure: Figure, characters: Characters, joints: Tensor, share: Tensor, wander: tuple[Tensor, Tensor]) -> Sway:
    """What bodies with joints at `joints` [B, J, 3] lack that walk by a `share` [B]; `wander` [B] goes from -1 to 1."""
    angle = characters.past[:, -1, PHASE.start] * (2 * math.pi) - _STRIKE
    once, twice = (_ASIDE, _TURN), (_AHEAD, _UP, _NOD, _HEAD)
    aside, turn = (amount * (angle + begin).cos() for amount, begin in once)
    ahead, up, nod, head = (amount * (2 * angle + begin).cos() for amount, begin in twice)
    slack = _slack(figure, joints) / size(figure)
    lower = (_TALLER[0] * slack).clamp_max(_TALLER[1]) + _LOWER * of(characters.manner, "height")
    lower = torch.minimum(lower, slack)
    hips = torch.stack([aside + _DRIFT[0] * wander[0], up + lower, ahead], -1)
    turn = turn * (1 + _TURNS * of(characters.manner, "hips"))
    nod = nod + _DRIFT[1] * wander[1]
    swing = torch.stack([-angle.sin(), angle.sin()], 1).clamp_min(0.0).square()
    feet = (_CLEAR * swing)[..., None] * torch.tensor([0.0, 1.0, 0.0])
    scaled = size(figure) * share[:, None]
    return Sway(scaled * hips, share * turn, share * nod, share * head, scaled[..., None] * feet)


def _slack(figure: Figure, joints: Tensor) -> Tensor:
    """How much higher hips may be before a leg is straight [B] [m]."""
    thigh, shin, foot = figure.legs[:, 0], figure.legs[:, 1], figure.legs[:, 2]
    length = _SLACK * (figure.lengths[shin] + figure.lengths[foot])
    way = joints[:, thigh] - joints[:, foot]
    across = way[..., ::2].square().sum(-1)
    return ((length.square() - across).clamp_min(0.0).sqrt() - way[..., 1]).amin(-1).clamp_min(0.0)
