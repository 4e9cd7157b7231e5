"""Life in a body that stands, sits or lies still: breath, small shifts, looks.

Only the shown frame is touched, never the state that the next step starts from. Trunk and head turn about their own
axes; a seated trunk shifts farther, and only to the front and the sides, so that it never goes into a back rest. Hands
stay where they rest: the arms are bent anew for them. The clock alone decides, and it starts where the character's seed
put it: the same seed breathes alike.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from roam_character.matrices import matrix_between, matrix_from_6d, matrix_from_rotvec, matrix_to_6d, unit
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.actions import IDLE, LIE
from roam_motion.animation.figure import Figure
from roam_motion.animation.manner import of
from roam_motion.animation.rows import Shapes, row_width, split_tensor
from roam_motion.animation.state import STYLE, Characters

_BREATH = 3.9, 0.12  # [s], and how much a deviate of `breath` changes it: people breathe 12 to 20 times a minute
_UNREST = 0.25  # how much a deviate of `unrest` changes the size of shifts
_SHIFTS = (7.3, 11.9, 17.1), (9.1, 13.7, 23.3), (6.1, 10.3, 19.9)  # [s] periods about a joint's x, y and z axis
# Degrees about the joint's left, up and forward axis: of the breath, and at most of the shifts.
_TURNS = {
    "spine": ((-0.3, 0.0, 0.0), (0.3, 0.4, 0.4)),
    "chest": ((-0.7, 0.0, 0.0), (0.5, 0.8, 0.7)),
    "upperChest": ((-1.1, 0.0, 0.0), (0.6, 1.2, 0.8)),
    "neck": ((-0.5, 0.0, 0.0), (0.8, 2.5, 0.6)),
    "head": ((-0.2, 0.0, 0.0), (1.6, 5.0, 0.8)),
    "leftShoulder": ((0.0, 0.0, 1.2), (0.0, 0.0, 0.0)),
    "rightShoulder": ((0.0, 0.0, -1.2), (0.0, 0.0, 0.0)),
}
_OF_BREATH, _OF_SHIFTS = torch.deg2rad(torch.tensor(list(_TURNS.values()))).unbind(1)  # [K, 3] [rad]
_RATES = 2 * math.pi / torch.tensor(_SHIFTS)  # [3, 3] [rad/s]

# Seated people shift every few seconds, within a second, and then keep still: periods [s] of shifts of the trunk and of
# looks, and the share of a period that a change takes. Sizes are tuned so that the mean joint stays within 1 cm.
_POSTURE, _LOOK, _SHIFTING = 5.3, 4.3, 0.22
_LEAN, _TURN, _TILT = (math.radians(angle) for angle in (5.0, 5.0, 2.5))  # of a seated trunk: forward, round, aside
_HANDS, _STROKE = 5.9, 0.03  # [s], [m] of hands that rest on the thighs
_KEPT_BACK = 0.55  # share of the lean where the back rests against something
_GLANCE = math.radians(24), math.radians(7)  # [rad] yaw and pitch of looks at most
_TABLE = 2 * torch.rand(256, 7, generator=torch.Generator().manual_seed(5)) - 1  # where shifts and looks go
_CHANNELS = 97  # entries of the table between the beginnings of two channels: they are not alike
_SPINE = ("spine", "chest", "upperChest")
_HEAD = (("upperChest", 0.1), ("neck", 0.35), ("head", 0.55))  # shares of a look
_ARMS = ("UpperArm", "LowerArm", "Hand")
_FURTHEST = math.radians(65), math.radians(30)  # yaw and pitch of a look that is asked for
_TURNS_IN = 0.12, 0.09  # share of the way to it, and [rad] that the head turns, in a frame at most
_STRAIGHT = 0.955, 0.985  # shares of an arm's length at which its hand begins to go along, and does
_LOOSELY = 0.6  # how much a hand stays that rests on the body and not on furniture
_EYES = 0.09  # [m] over the head's joint


@dataclass(frozen=True)
class Life:
    """What B still bodies are told of the world, a row of numbers each."""

    clock: Tensor  # [B] [s]
    hands: Tensor  # [B, 2] 1 where a hand rests on furniture
    back: Tensor  # [B] 1 where the back does
    target: Tensor  # [B, 3] what is looked at, in the world [m]
    looks: Tensor  # [B] 1 where there is something to look at

    @staticmethod
    def of(rows: Tensor) -> "Life":
        """From a row of numbers each [B, WIDTH]."""
        return Life(**split_tensor(rows, _SHAPES))


_SHAPES: Shapes = {
    "clock": (),
    "hands": (2,),
    "back": (),
    "target": (3,),
    "looks": (),
}  # the order of life_row's numbers
WIDTH = row_width(_SHAPES)  # numbers of `Life`


def life_row(clock: float, resting: tuple[float, float, float], target: np.ndarray | None) -> np.ndarray:
    """The row of numbers of one body [WIDTH]: `resting` are its hands and its back, `target` [3] what it looks at."""
    looked_at = (0.0, 0.0, 0.0) if target is None else target
    return np.array([clock, *resting, *looked_at, target is not None], np.float32)


def stillness(characters: Characters) -> Tensor:
    """How much of the living idle shows [B]: all of it in a held pose and when standing, none on the way."""
    return torch.maximum(characters.settled, characters.past[:, -1, STYLE.start + IDLE.column]).clamp(0.0, 1.0)


@cache
def _joints(figure: Figure) -> Tensor:
    return torch.tensor(figure.skeleton.indices(list(_TURNS)))


def alive(figure: Figure, characters: Characters, orientations: Tensor, life: Life) -> Tensor:
    """World orientations [B, J, 3, 3] with breath, shifts and looks."""
    share, joints = stillness(characters), _joints(figure)
    size = 1 + _UNREST * of(characters.manner, "unrest")
    angles = _breath(characters, life.clock)[:, None, None] * _OF_BREATH
    angles = angles + size[:, None, None] * _shift(life.clock)[:, None] * _OF_SHIFTS
    turns = matrix_from_rotvec(share[:, None, None] * angles)
    turned = orientations.index_copy(1, joints, orientations[:, joints] @ turns)
    seated = characters.settled * (1 - characters.past[:, -1, STYLE.start + LIE.column]).clamp(0.0, 1.0)
    turned = _shifted(figure, turned, seated * size, life)
    turned = _looking(figure, turned, share, characters.gaze, life.clock)
    kept = characters.settled[:, None] * (_LOOSELY + (1 - _LOOSELY) * life.hands)
    return _hands_kept(figure, characters.hips, orientations, turned, kept, _fidget(life) * (seated * size)[:, None])


def gazed(figure: Figure, characters: Characters, positions: Tensor, life: Life) -> Tensor:
    """The next gaze [B, 3] (see `Characters`) of bodies with joints at `positions` [B, J, 3]."""
    head = positions[:, figure.skeleton.index("head")]
    way = life.target - head - torch.tensor([0.0, _EYES, 0.0])
    here = figure.frame(positions)
    local = here.turn_in(way[:, None])[:, 0]
    yaw = torch.atan2(local[:, 0], local[:, 2]).clamp(-_FURTHEST[0], _FURTHEST[0])
    pitch = torch.atan2(-local[:, 1], local[:, ::2].square().sum(-1).clamp_min(1e-6).sqrt())
    wanted = torch.stack([yaw, pitch.clamp(-_FURTHEST[1], _FURTHEST[1])], -1) * life.looks[:, None]
    step = (_TURNS_IN[0] * (wanted - characters.gaze[:, :2])).clamp(-_TURNS_IN[1], _TURNS_IN[1])
    held = characters.gaze[:, 2:] + _TURNS_IN[0] * (life.looks[:, None] - characters.gaze[:, 2:])
    return torch.cat([characters.gaze[:, :2] + step, held], 1)


def _breath(characters: Characters, clock: Tensor) -> Tensor:
    """-1 breathed out .. 1 breathed in [B]; in is quicker than out."""
    period = _BREATH[0] * (1 + _BREATH[1] * of(characters.manner, "breath"))
    phase = clock / period * (2 * math.pi)
    return torch.sin(phase + 0.35 * torch.sin(phase))


def _shift(clock: Tensor) -> Tensor:
    """Slow wandering between -1 and 1 about three axes [B, 3]."""
    return torch.sin(clock[:, None, None] * _RATES).mean(-1)


def _wander(clock: Tensor, period: float, channel: int) -> Tensor:
    """Between -1 and 1 [B]: stays for most of each period [s], then goes on to another place."""
    gone = clock / period + _CHANNELS * channel
    which = gone.floor()
    change = ((gone - which - (1 - _SHIFTING)) / _SHIFTING).clamp(0.0, 1.0)
    change = change * change * (3 - 2 * change)
    count = len(_TABLE)
    here, there = _TABLE[which.long() % count, channel], _TABLE[(which.long() + 1) % count, channel]
    return torch.lerp(here, there, change)


def _shifted(figure: Figure, orientations: Tensor, size: Tensor, life: Life) -> Tensor:
    """Orientations with the trunk of somebody seated shifted by `size` [B], and all that it carries."""
    lean = _LEAN * (0.5 + 0.5 * _wander(life.clock, _POSTURE, 0)) * (1 - (1 - _KEPT_BACK) * life.back)
    turn = _TURN * _wander(life.clock, _POSTURE, 1)
    tilt = _TILT * _wander(life.clock, _POSTURE, 2)
    angles = size[:, None] * torch.stack([lean, turn, tilt], -1)
    first = figure.skeleton.index(_SPINE[0])
    trunk, carried = orientations[:, first], _carried(figure)
    turn_of_all = trunk @ matrix_from_rotvec(angles) @ trunk.mT
    return orientations.index_copy(1, carried, turn_of_all[:, None] @ orientations[:, carried])


@cache
def _carried(figure: Figure) -> Tensor:
    """The spine's first joint and all that it carries."""
    found = [figure.skeleton.index(_SPINE[0])]
    for joint, parent in enumerate(figure.skeleton.parents):
        if parent in found:
            found.append(joint)
    return torch.tensor(found)


def _looking(figure: Figure, orientations: Tensor, share: Tensor, gaze: Tensor, clock: Tensor) -> Tensor:
    """Orientations with neck and head turned to what is looked at, else a little here and there."""
    about = share * (1 - gaze[:, 2])
    yaw = gaze[:, 0] + about * _GLANCE[0] * _wander(clock, _LOOK, 3).pow(3)  # mostly ahead
    pitch = gaze[:, 1] + about * _GLANCE[1] * _wander(clock, _LOOK, 4)
    names = [name for name, _ in _HEAD]
    joints = torch.tensor(figure.skeleton.indices(names))
    angles = torch.stack([pitch, yaw, torch.zeros_like(yaw)], -1)[:, None]
    shares = torch.tensor([part for _, part in _HEAD]).cumsum(0)[:, None]
    return orientations.index_copy(1, joints, orientations[:, joints] @ matrix_from_rotvec(shares * angles))


def _fidget(life: Life) -> Tensor:
    """How far hands that do not rest on furniture are moved along the thighs [B, 2] [m]."""
    way = torch.stack([_wander(life.clock, _HANDS, 5), _wander(life.clock, 1.3 * _HANDS, 6)], -1)
    return _STROKE * way * (1 - life.hands)


def _hands_kept(figure: Figure, hips: Tensor, before: Tensor, after: Tensor, kept: Tensor, along: Tensor) -> Tensor:
    """Orientations `after` with arms bent so that the hands are, as much as `kept` [B, 2] says, as in `before`.

    They move `along` [B, 2] [m] their thighs. An arm that hangs straight has nothing to bend with: its hand goes along.
    """
    arms = _arm_joints(figure)
    joints = figure.positions(hips, after)
    shoulder, elbow, wrist = (joints[:, arms[:, column]] for column in range(3))
    upper, lower = (figure.lengths[arms[:, column], None] for column in (1, 2))
    straight = vector_norm(wrist - shoulder, dim=-1) / (upper + lower)[:, 0]
    bends = ((_STRAIGHT[1] - straight) / (_STRAIGHT[1] - _STRAIGHT[0])).clamp(0.0, 1.0)
    kept, along = (bends * kept)[..., None], (bends * along)[..., None]
    thighs = unit(joints[:, figure.legs[:, 1]] - joints[:, figure.legs[:, 0]])
    there = torch.lerp(wrist, figure.positions(hips, before)[:, arms[:, 2]], kept) + along * thighs
    way = there - shoulder
    reach = vector_norm(way, dim=-1, keepdim=True)
    way = way / reach.clamp_min(1e-6)
    reach = torch.minimum(torch.maximum(reach, (upper - lower).abs() + 1e-3), 0.9999 * (upper + lower))
    cosine = ((upper.square() + reach.square() - lower.square()) / (2 * upper * reach)).clamp(-1.0, 1.0)
    side = elbow - shoulder
    side = unit(side - (side * way).sum(-1, keepdim=True) * way)
    bent = shoulder + upper * (cosine * way + (1 - cosine.square()).clamp_min(0.0).sqrt() * side)
    turned = torch.stack(
        [
            matrix_between(elbow - shoulder, bent - shoulder) @ after[:, arms[:, 0]],
            matrix_between(wrist - elbow, shoulder + reach * way - bent) @ after[:, arms[:, 1]],
            matrix_from_6d(torch.lerp(matrix_to_6d(after[:, arms[:, 2]]), matrix_to_6d(before[:, arms[:, 2]]), kept)),
        ],
        2,
    )
    return after.index_copy(1, arms.flatten(), turned.flatten(1, 2))


@cache
def _arm_joints(figure: Figure) -> Tensor:
    """[2, 3]: upper arm, lower arm, hand."""
    return torch.tensor([figure.skeleton.indices([side + part for part in _ARMS]) for side in ("left", "right")])
