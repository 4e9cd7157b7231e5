"""What every measure sees: frames of the humanoid skeleton's 22 joints, 30 a second, and nothing else.

Captured clips and the product's frames become the same `Motion`, so that no measure can tell where they came from.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from roam_character.skeleton import humanoid_skeleton

SKELETON = humanoid_skeleton()
RATE = 30.0  # [Hz]
SIDES = ("left", "right")
HIPS, NECK, HEAD = SKELETON.indices(["hips", "neck", "head"])


def both(bone: str) -> list[int]:
    """Joint indices of a bone's left and right."""
    return SKELETON.indices([f"{side}{bone}" for side in SIDES])


THIGHS, KNEES, ANKLES, TOES = (both(b) for b in ("UpperLeg", "LowerLeg", "Foot", "Toes"))
SHOULDERS, ELBOWS, HANDS = both("UpperArm"), both("LowerArm"), both("Hand")


@dataclass(frozen=True)
class Stretch:
    """Frames `first` to `last` (inclusive) in which somebody does one thing."""

    label: str  # idle, walk, turn, sit, lie, run …
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames of one person at 30 Hz; +Y up, the floor at zero."""

    name: str
    person: str  # captured: the subject; made: the seed
    positions: np.ndarray  # [T, 22, 3] [m]
    stretches: tuple[Stretch, ...] = ()
    told: str = ""  # what the product was told ("steer 0.9", "turn 90", "approach"); captured: ""

    def __len__(self) -> int:
        return len(self.positions)

    def cut(self, first: int, last: int) -> "Motion":
        """Frames `first` to `last`, inclusive, without labels."""
        return Motion(self.name, self.person, self.positions[first : last + 1], (), self.told)

    @cached_property
    def hips(self) -> np.ndarray:
        """Middle of the hip joints [T, 3] [m]."""
        return self.positions[:, THIGHS].mean(1)

    @cached_property
    def facing(self) -> np.ndarray:
        """Unwrapped yaw of the torso [T] [rad]: up x (hips + shoulders from left to right), the paper's rule."""
        across = _unit(_level(self.positions, THIGHS)) + _unit(_level(self.positions, SHOULDERS))
        return np.unwrap(np.arctan2(-across[:, 1], across[:, 0]) + np.pi)

    @cached_property
    def pelvis(self) -> np.ndarray:
        """Unwrapped yaw of the pelvis [T] [rad], from the hip joints."""
        across = _level(self.positions, THIGHS)
        return np.unwrap(np.arctan2(-across[:, 1], across[:, 0]) + np.pi)

    @cached_property
    def feet(self) -> np.ndarray:
        """Unwrapped yaws of both feet [T, 2] [rad], ankle to toe joint."""
        ahead = self.positions[:, TOES] - self.positions[:, ANKLES]
        return np.unwrap(np.arctan2(ahead[..., 0], ahead[..., 2]), axis=0)

    def ahead(self, points: np.ndarray, yaw: np.ndarray | None = None) -> np.ndarray:
        """How far points [T, N, 3] are ahead of the middle of the hip joints [T, N] [m], along `yaw` (the facing)."""
        turn = self.facing if yaw is None else yaw
        offset = points - self.hips[:, None]
        return offset[..., 0] * np.sin(turn)[:, None] + offset[..., 2] * np.cos(turn)[:, None]

    def aside(self, points: np.ndarray, yaw: np.ndarray | None = None) -> np.ndarray:
        """How far points [T, N, 3] are to the left of the middle of the hip joints [T, N] [m]."""
        turn = self.facing if yaw is None else yaw
        offset = points - self.hips[:, None]
        return offset[..., 0] * np.cos(turn)[:, None] - offset[..., 2] * np.sin(turn)[:, None]

    @cached_property
    def local(self) -> np.ndarray:
        """Joints in the frame of the hips on the floor [T, 22, 3] [m]: left, up, ahead."""
        return np.stack([self.aside(self.positions), self.positions[..., 1], self.ahead(self.positions)], -1)


def _level(positions: np.ndarray, pair: list[int]) -> np.ndarray:
    """From left to right joint on the floor, (x, z) [T, 2]."""
    return (positions[:, pair[1]] - positions[:, pair[0]])[:, [0, 2]]


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
