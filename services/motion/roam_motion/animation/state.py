"""A character between two frames: small, serialisable, and stackable into one batch."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import accumulate

import torch
from roam_character.tensors.elementary import cosine, sine
from torch import Tensor

from roam_motion.actions import STYLES, WALK
from roam_motion.animation.figure import CONTACT_JOINTS
from roam_motion.animation.manner import NAMES
from roam_motion.animation.rows import join, row_width, split_tensor

FRAME_RATE = 30  # [Hz]
KEY_STRIDE = 5  # frames between trajectory keys: 1/6 s
PAST = 31  # frames of history: -1 s to now
FUTURE = 6  # keys after now: +1/6 s to +1 s
KEYS = (PAST - 1) // KEY_STRIDE + 1 + FUTURE  # of the whole trajectory, now included


def _slices(widths: Mapping[str, int]) -> list[slice]:
    ends = list(accumulate(widths.values()))
    return [slice(end - width, end) for end, width in zip(ends, widths.values(), strict=True)]


_KEY = {"place": 2, "direction": 2, "styles": len(STYLES), "phase": 1}  # numbers of one key of a trajectory
PLACE, DIRECTION, STYLE, PHASE = _slices(_KEY)  # their columns
ROOT, LABELLED = slice(0, DIRECTION.stop), slice(0, STYLE.stop)  # place and direction; the same with styles
KEY_WIDTH = sum(_KEY.values())
_STROLL = 0.5, 0.3  # [m] way of the next second from which on that counts as walking, and how gradually


@dataclass
class Characters:
    """B characters as tensors; everything in the world, metres and seconds."""

    hips: Tensor  # [B, 3]
    orientations: Tensor  # [B, J, 3, 3] world orientation of every joint
    velocities: Tensor  # [B, J, 3] [m/s]
    past: Tensor  # [B, 31, 9] keys: root x, z, direction x, z, style labels, phase; oldest first, now last
    future: Tensor  # [B, 6, 9] the same at the six future keys; phase counted on from now
    contacts: Tensor  # [B, 4] predicted contact, 0..1
    locks: Tensor  # [B, 4, 3] where each contact is held
    lock_weights: Tensor  # [B, 4] 0 free .. 1 held
    settled: Tensor  # [B] how far the held pose has been drawn onto the goal pose, 0..1
    blend: Tensor  # [B] the bidirectional weight in use, 0..1
    standing: Tensor  # [B] 0 going .. 1 standing, where feet step by rule (see stepping.py)
    steps: Tensor  # [B, 2] share of its step by rule that a foot has behind it, 0 on the ground
    manner: Tensor  # [B, 9] who it is (see manner.py); never changes
    gaze: Tensor  # [B, 3] yaw and pitch of the head against the body [rad], and how much a look is being held, 0..1
    linger: Tensor  # [B, 3] from its hips to those that are shown, who settle on a seat more slowly [m]

    @staticmethod
    def of(rows: Tensor) -> "Characters":
        """A batch from the numbers of every character [B, D]."""
        return Characters(**split_tensor(rows, shapes_of(rows.shape[1])))

    def rows(self) -> Tensor:
        """The numbers of every character [B, D], in the order of the fields."""
        return join(vars(self))


def _shapes(joints: int) -> dict[str, tuple[int, ...]]:
    """The shapes of a single character's fields."""
    contacts = len(CONTACT_JOINTS)
    return {
        "hips": (3,),
        "orientations": (joints, 3, 3),
        "velocities": (joints, 3),
        "past": (PAST, KEY_WIDTH),
        "future": (FUTURE, KEY_WIDTH),
        "contacts": (contacts,),
        "locks": (contacts, 3),
        "lock_weights": (contacts,),
        "settled": (),
        "blend": (),
        "standing": (),
        "steps": (2,),
        "manner": (len(NAMES),),
        "gaze": (3,),
        "linger": (3,),
    }


def characters_width(joints: int) -> int:
    """How many numbers D a character has."""
    return row_width(_shapes(joints))


@cache
def shapes_of(width: int) -> dict[str, tuple[int, ...]]:
    """The shapes of a single character's fields that has so many numbers D."""
    without, with_one = characters_width(0), characters_width(1)
    return _shapes((width - without) // (with_one - without))


def strolling(characters: Characters) -> Tensor:
    """How much each one walks [B], 0..1: those who go on for a second, not who takes a few steps on the spot."""
    way = torch.linalg.vector_norm(characters.future[:, -1, PLACE] - characters.past[:, -1, PLACE], dim=-1)
    return characters.past[:, -1, STYLE.start + WALK.column].clamp(0.0, 1.0) * ((way - _STROLL[0]) / _STROLL[1]).clamp(
        0.0, 1.0
    )


def phase_vector(phase: Tensor) -> Tensor:
    """[...] phase in turns -> [..., 2] (sin, cos)."""
    angle = phase * (2 * torch.pi)
    return torch.stack([sine(angle), cosine(angle)], -1)
