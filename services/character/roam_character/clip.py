"""A motion: poses of one skeleton at a constant frame rate."""

from dataclasses import dataclass, replace

import numpy as np

from roam_character.kinematics import Posture, forward_kinematics
from roam_character.pose import Pose
from roam_character.rotation import quat_slerp
from roam_character.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Clip:
    """A sequence of T poses.

    Raises ValueError when shapes do not fit the skeleton or there is no frame.
    """

    skeleton: Skeleton
    frame_rate: float  # [Hz]
    root_positions: np.ndarray  # [T, 3] [m]
    rotations: np.ndarray  # [T, J, 4] local, xyzw

    def __post_init__(self) -> None:
        count = len(self.root_positions)
        if count == 0 or self.frame_rate <= 0:
            raise ValueError("a clip needs at least one frame and a positive frame rate")
        if self.root_positions.shape != (count, 3) or self.rotations.shape != (count, self.skeleton.joint_count, 4):
            raise ValueError("root_positions must be [T, 3] and rotations [T, J, 4]")

    def __len__(self) -> int:
        return len(self.root_positions)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.frame_rate

    def posture(self) -> Posture:
        """World positions [T, J, 3] [m] and orientations [T, J, 4]."""
        return forward_kinematics(self.skeleton, self.root_positions, self.rotations)

    def positions(self) -> np.ndarray:
        """World joint positions [T, J, 3] [m]."""
        return np.asarray(self.posture().positions)

    def pose(self, frame: int) -> Pose:
        """The pose of one frame."""
        return Pose(self.skeleton, self.root_positions[frame], self.rotations[frame])

    def cut(self, first: int, last: int) -> "Clip":
        """Frames first..last, both included."""
        return replace(
            self, root_positions=self.root_positions[first : last + 1], rotations=self.rotations[first : last + 1]
        )

    def resampled(self, frame_rate: float) -> "Clip":
        """The same motion at another rate: positions linear, rotations spherical."""
        if frame_rate == self.frame_rate or len(self) == 1:
            return replace(self, frame_rate=frame_rate)
        at = np.arange(int(np.floor(self.duration * frame_rate + 1e-6)) + 1) * (self.frame_rate / frame_rate)
        low = np.minimum(at.astype(int), len(self) - 2)
        t = (at - low)[:, None]
        roots = self.root_positions[low] * (1 - t) + self.root_positions[low + 1] * t
        turns = quat_slerp(self.rotations[low], self.rotations[low + 1], t[..., None])
        dtype = self.rotations.dtype
        return replace(self, frame_rate=frame_rate, root_positions=roots.astype(dtype), rotations=turns.astype(dtype))

    def mirrored(self) -> "Clip":
        """Left and right exchanged, by reflection in the plane x = 0; the skeleton must be symmetric."""
        flip_position = np.array([-1, 1, 1], self.root_positions.dtype)
        flip_rotation = np.array([1, -1, -1, 1], self.rotations.dtype)
        rotations = self.rotations[:, list(self.skeleton.mirror)] * flip_rotation
        return replace(self, root_positions=self.root_positions * flip_position, rotations=rotations)


def clip_of(poses: list[Pose], frame_rate: float) -> Clip:
    """A clip of poses of one skeleton."""
    return Clip(
        poses[0].skeleton,
        frame_rate,
        np.stack([pose.root_position for pose in poses]),
        np.stack([pose.rotations for pose in poses]),
    )
