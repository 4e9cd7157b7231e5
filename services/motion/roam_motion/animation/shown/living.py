"""Life in a body that stands, sits or lies still: breath, small shifts, looks; and the sway of one that walks.

Only the shown frame is touched, never the state that the next step starts from. Who sits moves as captured people do
who sit (seated_life.py), and leans only to the front and the sides, so that it never goes into a back rest; who walks
goes along with its steps (gait.py). Feet stay where they are and hands where they rest: legs and arms are bent anew.
The clock alone decides, and it starts where the character's seed put it: the same seed breathes alike.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from roam_character.kinematics import bent_joint
from roam_character.matrices import matrix_between, matrix_from_6d, matrix_from_rotvec, matrix_to_6d
from roam_character.tensors.elementary import arctangent, sine
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.actions import IDLE, LIE
from roam_motion.animation.figure import Figure
from roam_motion.animation.manner import of
from roam_motion.animation.rows import Shapes, row_width, split_tensor
from roam_motion.animation.shown.gait import Sway, sway
from roam_motion.animation.shown.seated_life import BONES, Fidget, fidget
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

# Looks change every few seconds, within a second: their period [s], and the share of it that a change takes.
_LOOK, _SHIFTING, _DRIFTS = 4.3, 0.22, 1.9
# Shares of what captured people do, of trunk, hips and hands, tuned so that the mean joint stays within 1 cm.
_AS_CAPTURED = 0.55, 0.65, 0.5
_STANDING = torch.tensor([0.007, 0.0, 0.005])  # [m] hips of who stands, aside and ahead, at most
_DOWN = 0.25  # share of movements down, where there is a seat or a thigh
_GLANCE = math.radians(24), math.radians(7)  # [rad] yaw and pitch of looks at most
_TABLE = 2 * torch.rand(256, 7, generator=torch.Generator().manual_seed(5)) - 1  # where shifts and looks go
_CHANNELS = 97  # entries of the table between the beginnings of two channels: they are not alike
_HEAD = (("upperChest", 0.1), ("neck", 0.35), ("head", 0.55))  # shares of a look
_LIMBS = ("UpperLeg", "LowerLeg", "Foot"), ("UpperArm", "LowerArm", "Hand")
_FURTHEST = math.radians(65), math.radians(30)  # yaw and pitch of a look that is asked for
_TURNS_IN = 0.12, 0.09  # share of the way to it, and [rad] that the head turns, in a frame at most
_GLANCES = 0.5  # share of their looks about that people have who walk
_FORWARD = torch.tensor([0.02, 0.02, 0.0, 0.0])[:, None]  # that straight knees bend forward
_NODS = torch.tensor([0.0, *[1.0] * (len(BONES) - 1)])  # bones that go along with the trunk
_OF_HEAD = torch.tensor([float(bone == "head") + 0.5 * (bone == "neck") for bone in BONES])
_OF_PELVIS = torch.tensor([1.0, 0.4, *[0.0] * (len(BONES) - 2)])
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


# The order of life_row's numbers.
_SHAPES: Shapes = {"clock": (), "hands": (2,), "back": (), "target": (3,), "looks": ()}
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


def alive(
    figure: Figure, characters: Characters, orientations: Tensor, life: Life, walks: Tensor
) -> tuple[Tensor, Tensor]:
    """Hips [B, 3] and world orientations [B, J, 3, 3] with breath, shifts and looks, and with the sway of who walks.

    `walks` [B] says how much each one walks.
    """
    share, seated = stillness(characters), _sits(characters)
    size = 1 + _UNREST * of(characters.manner, "unrest")
    joints = figure.positions(characters.hips, orientations)
    root = figure.frame(joints)
    turned = _breathing(figure, characters, orientations, life, share, size * (1 - seated))
    fidgets, gait = fidget(life.clock), sway(figure, characters, joints, walks, _drift(life.clock))
    amount = (seated * size)[:, None]
    turns = root.turn_out(_trunk_turns(fidgets, gait, amount, life.back))
    bones = _bones(figure)
    turned = turned.index_copy(1, bones, matrix_from_rotvec(turns) @ turned[:, bones])
    turned = _looking(figure, turned, torch.maximum(share, _GLANCES * walks), characters.gaze, life.clock)
    stands = (share - characters.settled).clamp_min(0.0) * (1 - characters.blend)
    shift = (stands * size)[:, None] * _STANDING * _shift(life.clock)
    moves = (gait.hips + shift + _AS_CAPTURED[1] * amount * _lifted(fidgets.hips))[:, None]
    hands = _AS_CAPTURED[2] * amount[..., None] * _lifted(fidgets.wrists) * (1 - life.hands)[..., None]
    moves = root.turn_out(torch.cat([moves, hands], 1))
    hips = characters.hips + characters.linger + moves[:, 0]
    kept = characters.settled[:, None] * (_LOOSELY + (1 - _LOOSELY) * life.hands)
    moves = torch.cat([gait.feet, moves[:, 1:]], 1)
    return hips, _limbs_kept(figure, joints, hips, orientations, turned, kept, moves)


def _sits(characters: Characters) -> Tensor:
    """How much each one sits and holds it [B]."""
    return characters.settled * (1 - characters.past[:, -1, STYLE.start + LIE.column]).clamp(0.0, 1.0)


def _breathing(
    figure: Figure, characters: Characters, orientations: Tensor, life: Life, share: Tensor, size: Tensor
) -> Tensor:
    """Orientations with breath, and with shifts of a `size` [B], by a `share` [B]."""
    joints = _joints(figure)
    angles = _breath(characters, life.clock)[:, None, None] * _OF_BREATH
    angles = angles + size[:, None, None] * _shift(life.clock)[:, None] * _OF_SHIFTS
    turns = matrix_from_rotvec(share[:, None, None] * angles)
    return orientations.index_copy(1, joints, orientations[:, joints] @ turns)


def _trunk_turns(fidgets: Fidget, gait: Sway, amount: Tensor, back: Tensor) -> Tensor:
    """Turns [B, K, 3] of the trunk's bones; one whose back rests on something leans forward only."""
    turns = _AS_CAPTURED[0] * amount[..., None] * fidgets.turns
    lean = turns[..., 0]
    lean = torch.lerp(lean, lean.clamp_min(0.0), back[:, None])
    nod = gait.trunk[:, None] * _NODS + gait.head[:, None] * _OF_HEAD
    yaw = turns[..., 1] + gait.pelvis[:, None] * _OF_PELVIS
    return torch.stack([lean + nod, yaw, turns[..., 2]], -1)


def _lifted(moves: Tensor) -> Tensor:
    """Movements [..., 3] that go down less than up."""
    up = moves[..., 1]
    return torch.stack([moves[..., 0], torch.where(up < 0, _DOWN * up, up), moves[..., 2]], -1)


def _drift(clock: Tensor) -> tuple[Tensor, Tensor]:
    """Two slow wanderings [B] of who walks."""
    return _wander(clock, _DRIFTS, 0), _wander(clock, 1.3 * _DRIFTS, 1)


@cache
def _bones(figure: Figure) -> Tensor:
    return torch.tensor(figure.skeleton.indices(list(BONES)))


def gazed(figure: Figure, characters: Characters, positions: Tensor, life: Life) -> Tensor:
    """The next gaze [B, 3] (see `Characters`) of bodies with joints at `positions` [B, J, 3]."""
    head = positions[:, figure.skeleton.index("head")]
    way = life.target - head - torch.tensor([0.0, _EYES, 0.0])
    here = figure.frame(positions)
    local = here.turn_in(way[:, None])[:, 0]
    yaw = arctangent(local[:, 0], local[:, 2]).clamp(-_FURTHEST[0], _FURTHEST[0])
    pitch = arctangent(-local[:, 1], local[:, ::2].square().sum(-1).clamp_min(1e-6).sqrt())
    wanted = torch.stack([yaw, pitch.clamp(-_FURTHEST[1], _FURTHEST[1])], -1) * life.looks[:, None]
    step = (_TURNS_IN[0] * (wanted - characters.gaze[:, :2])).clamp(-_TURNS_IN[1], _TURNS_IN[1])
    held = characters.gaze[:, 2:] + _TURNS_IN[0] * (life.looks[:, None] - characters.gaze[:, 2:])
    return torch.cat([characters.gaze[:, :2] + step, held], 1)


def _breath(characters: Characters, clock: Tensor) -> Tensor:
    """-1 breathed out .. 1 breathed in [B]; in is quicker than out."""
    period = _BREATH[0] * (1 + _BREATH[1] * of(characters.manner, "breath"))
    phase = clock / period * (2 * math.pi)
    return sine(phase + 0.35 * sine(phase))


def _shift(clock: Tensor) -> Tensor:
    """Slow wandering between -1 and 1 about three axes [B, 3]."""
    return sine(clock[:, None, None] * _RATES).mean(-1)


def _wander(clock: Tensor, period: float, channel: int) -> Tensor:
    """Between -1 and 1 [B]: stays for most of each period [s], then goes on to another place."""
    gone = clock / period + _CHANNELS * channel
    which = gone.floor()
    change = ((gone - which - (1 - _SHIFTING)) / _SHIFTING).clamp(0.0, 1.0)
    change = change * change * (3 - 2 * change)
    count = len(_TABLE)
    here, there = _TABLE[which.long() % count, channel], _TABLE[(which.long() + 1) % count, channel]
    return torch.lerp(here, there, change)


def _looking(figure: Figure, orientations: Tensor, share: Tensor, gaze: Tensor, clock: Tensor) -> Tensor:
    """Orientations with neck and head turned to what is looked at, else a little here and there."""
    about = share * (1 - gaze[:, 2])
    aside = _wander(clock, _LOOK, 3)
    yaw = gaze[:, 0] + about * _GLANCE[0] * aside * aside * aside  # mostly ahead
    pitch = gaze[:, 1] + about * _GLANCE[1] * _wander(clock, _LOOK, 4)
    names = [name for name, _ in _HEAD]
    joints = torch.tensor(figure.skeleton.indices(names))
    angles = torch.stack([pitch, yaw, torch.zeros_like(yaw)], -1)[:, None]
    shares = torch.tensor([part for _, part in _HEAD]).cumsum(0)[:, None]
    return orientations.index_copy(1, joints, orientations[:, joints] @ matrix_from_rotvec(shares * angles))


def _limbs_kept(
    figure: Figure, before: Tensor, hips: Tensor, start: Tensor, after: Tensor, kept: Tensor, along: Tensor
) -> Tensor:
    """Orientations `after` with legs bent so that the ankles are as in `before` [B, J, 3], and arms so that the hands
    are, as much as `kept` [B, 2] says; ankles and hands move `along` [B, 4, 3] [m].

    An arm that hangs straight has nothing to bend with: its hand goes along. `start` are the orientations of `before`.
    """
    limbs = _limbs(figure)
    root, middle, end = (limbs[:, column] for column in range(3))
    joints = figure.positions(hips, after)
    first, bend, tip = joints[:, root], joints[:, middle], joints[:, end]
    upper, lower = figure.lengths[middle, None], figure.lengths[end, None]
    straight = vector_norm(tip[:, 2:] - first[:, 2:], dim=-1) / (upper + lower)[2:, 0]
    bends = ((_STRAIGHT[1] - straight) / (_STRAIGHT[1] - _STRAIGHT[0])).clamp(0.0, 1.0)
    kept = torch.cat([torch.ones_like(kept), bends * kept], 1)[..., None]
    moved = torch.cat([along[:, :2], along[:, 2:] * bends[..., None]], 1)
    there = torch.lerp(tip, before[:, end], kept) + moved
    way = there - first
    reach = vector_norm(way, dim=-1, keepdim=True)
    way = way / reach.clamp_min(1e-6)
    reach = torch.minimum(torch.maximum(reach, (upper - lower).abs() + 1e-3), 0.9999 * (upper + lower))
    reached = first + reach * way
    bent = bent_joint(first, reached, (upper, lower), bend - first + _FORWARD * after[:, root][..., 2])
    hands = end[2:]
    turned = [
        matrix_between(bend - first, bent - first) @ after[:, root],
        matrix_between(tip - bend, reached - bent) @ after[:, middle],
        matrix_from_6d(torch.lerp(matrix_to_6d(after[:, hands]), matrix_to_6d(start[:, hands]), kept[:, 2:])),
    ]
    return after.index_copy(1, torch.cat([root, middle, hands]), torch.cat(turned, 1))


@cache
def _limbs(figure: Figure) -> Tensor:
    """[4, 3]: left and right leg, left and right arm, three joints each."""
    names = [[side + part for part in limb] for limb in _LIMBS for side in ("left", "right")]
    return torch.tensor([figure.skeleton.indices(limb) for limb in names])
