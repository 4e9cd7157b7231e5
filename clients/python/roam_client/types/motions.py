"""A motion: the frames of a session, baked into arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from roam_client.connection.packing import Floats
from roam_client.types.actions import Action, action_names
from roam_client.types.files import save_arrays
from roam_client.types.frames import Frame
from roam_client.types.goal_poses import GoalPose
from roam_client.types.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames at one rate, in the same world space as the goal pose (the object's own placement)."""

    skeleton: Skeleton
    frame_rate: float  # [1/s]
    root_positions: Floats  # [T, 3] [m]
    rotations: Floats  # [T, J, 4] local, xyzw
    joint_positions: Floats  # [T, J, 3] [m]
    contacts: npt.NDArray[np.bool_]  # [T, 4] leftFoot, leftToes, rightFoot, rightToes
    actions: npt.NDArray[np.int32]  # [T] Action
    goal: GoalPose | None = None
    goal_reached: int | None = None  # index of the first frame at the goal

    @classmethod
    def from_frames(
        cls,
        frames: Sequence[Frame],
        *,
        skeleton: Skeleton,
        frame_rate: float,
        goal: GoalPose | None = None,
        goal_reached: int | None = None,
    ) -> Self:
        """Stacks frames."""
        return cls(
            skeleton=skeleton,
            frame_rate=frame_rate,
            root_positions=np.stack([frame.root_position for frame in frames]),
            rotations=np.stack([frame.rotations for frame in frames]),
            joint_positions=np.stack([frame.joint_positions for frame in frames]),
            contacts=np.stack([frame.contacts for frame in frames]),
            actions=np.array([frame.action for frame in frames], np.int32),
            goal=goal,
            goal_reached=goal_reached,
        )

    @property
    def frame_count(self) -> int:
        """Number of frames T."""
        return len(self.root_positions)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.frame_count / self.frame_rate

    def goal_distances(self) -> Floats:
        """Mean joint distance to the goal pose [m]. -> [T]. ValueError without a goal."""
        if self.goal is None:
            raise ValueError("this motion has no goal")
        distances = np.linalg.norm(self.joint_positions - self.goal.joint_positions, axis=-1)
        return np.asarray(distances.mean(axis=-1), np.float32)

    def action_at(self, frame: int) -> Action:
        """The dominant action of one frame."""
        return Action(int(self.actions[frame]))

    def arrays(self) -> dict[str, Any]:
        """What is saved; other tools rely on these names."""
        arrays: dict[str, Any] = {
            "joint_names": np.array(self.skeleton.joint_names),
            "parents": np.array(self.skeleton.parents, np.int32),
            "root_position": self.root_positions,
            "rotations": self.rotations,
            "joint_positions": self.joint_positions,
            "contacts": self.contacts,
            "action": self.actions,
            "action_names": action_names(),
            "fps": np.float64(self.frame_rate),
        }
        if self.goal is not None:
            arrays["goal_joint_positions"] = self.goal.joint_positions
            arrays["object_to_world"] = self.goal.object_to_world
            arrays["floor_height"] = np.float64(self.goal.floor_height)
        return arrays

    def save(self, path: str | Path) -> None:
        """Writes .npz or .json; FormatError for another ending."""
        extra: dict[str, Any] = {"goal_reached": self.goal_reached}
        if self.goal is not None:
            extra |= {"goal_pose": self.goal.name, "object": self.goal.object}
        save_arrays(Path(path), self.arrays(), extra)
