"""One full-body configuration of a skeleton: the paper's P = {t_root, p_j} (section 3.1)."""

from dataclasses import dataclass, replace

import numpy as np

from roam_character.kinematics import Posture, facing, forward_kinematics, tip_positions
from roam_character.rotation import quat_from_yaw, quat_mul, quat_rotate
from roam_character.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Pose:
    """A pose in the world.

    Raises ValueError when shapes do not fit the skeleton or a number is not finite.
    """

    skeleton: Skeleton
    root_position: np.ndarray  # [3] [m]
    rotations: np.ndarray  # [J, 4] local, xyzw

    def __post_init__(self) -> None:
        shape = (self.skeleton.joint_count, 4)
        if self.root_position.shape != (3,) or self.rotations.shape != shape:
            raise ValueError(f"a pose of this skeleton has root_position [3] and rotations {list(shape)}")
        if not (np.isfinite(self.root_position).all() and np.isfinite(self.rotations).all()):
            raise ValueError("a pose must be finite: root_position or rotations contain NaN or infinity")

    def posture(self) -> Posture:
        """World positions [J, 3] [m] and orientations [J, 4] of all joints."""
        return forward_kinematics(self.skeleton, self.root_position, self.rotations)

    def positions(self) -> np.ndarray:
        """World joint positions [J, 3] [m]."""
        return np.asarray(self.posture().positions)

    def tips(self) -> np.ndarray:
        """World positions of the skeleton's tips [T, 3] [m]."""
        return np.asarray(tip_positions(self.skeleton, *self.posture()))

    def yaw(self) -> float:
        """The heading of hips and shoulders on the floor [rad]."""
        return float(facing(self.skeleton, self.positions()))

    def moved(self, offset: np.ndarray) -> "Pose":
        """The same pose elsewhere; `offset` [3] [m]."""
        return replace(self, root_position=self.root_position + np.asarray(offset, self.root_position.dtype))

    def turned(self, yaw: float) -> "Pose":
        """The pose turned about the world's +Y axis through the origin [rad]."""
        turn = quat_from_yaw(np.asarray(yaw, self.rotations.dtype))
        rotations = self.rotations.copy()
        rotations[0] = quat_mul(turn, rotations[0])
        return replace(self, root_position=quat_rotate(turn, self.root_position), rotations=rotations)


def rest_pose(skeleton: Skeleton) -> Pose:
    """The rest pose, standing on the floor."""
    return Pose(skeleton, skeleton.rest_offsets[0].copy(), skeleton.rest_rotations.copy())
