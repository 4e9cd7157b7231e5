"""Goal poses: what the optimisation answers, its progress, and the reference poses it starts from."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from roam.v1 import goal_pose_pb2, motion_pb2, skeleton_pb2

from roam_client.connection.packing import Floats, pack_floats, unpack_floats
from roam_client.types.actions import Action, action_from_message
from roam_client.types.files import save_arrays
from roam_client.types.objects import Object, Warning, outlines_from_messages, warnings_from_messages
from roam_client.types.pose_quality import PoseQuality
from roam_client.types.pose_wishes import PoseWishes
from roam_client.types.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Pose:
    """One full-body configuration."""

    skeleton_id: str
    root_position: Floats  # [3] world [m]
    rotations: Floats  # [J, 4] local, xyzw

    @classmethod
    def from_message(cls, message: skeleton_pb2.Pose) -> Self:
        """Decodes."""
        return cls(
            skeleton_id=message.skeleton_id,
            root_position=unpack_floats(message.root_position, (3,), field="root_position"),
            rotations=unpack_floats(message.rotations, (-1, 4), field="rotations"),
        )

    @property
    def message(self) -> skeleton_pb2.Pose:
        """The protocol's form."""
        return skeleton_pb2.Pose(
            skeleton_id=self.skeleton_id,
            root_position=pack_floats(self.root_position),
            rotations=pack_floats(self.rotations),
        )


@dataclass(frozen=True, eq=False)
class Progress:
    """A moment of the optimisation."""

    stage: int  # 1..3; 0 while preparing
    stage_name: str
    iteration: int
    iteration_count: int
    energy: float
    pose: Pose | None

    @classmethod
    def from_message(cls, message: goal_pose_pb2.Progress) -> Self:
        """Decodes."""
        return cls(
            stage=message.stage,
            stage_name=message.stage_name,
            iteration=message.iteration,
            iteration_count=message.iteration_count,
            energy=message.energy,
            pose=Pose.from_message(message.pose) if message.HasField("pose") else None,
        )


@dataclass(frozen=True, eq=False)
class GoalPose:
    """A pose on one object, in that object's own placement (metres, Y up), and how good it is."""

    name: str  # "goalPoses/sha256:<hex>"
    skeleton: Skeleton
    root_position: Floats  # [3] [m]
    rotations: Floats  # [J, 4] local, xyzw
    joint_positions: Floats  # [J, 3] [m]
    energies: dict[str, float]  # every term, weighted, and "total"
    diagnostics: dict[str, float]  # hip_seat_distance, penetration_depth, floor_distance [m], heading [rad], …
    warnings: tuple[Warning, ...]
    object: str
    reference_pose: str
    action: Action
    floor_height: float  # [m]
    object_to_world: npt.NDArray[np.float64]  # [4, 4] what was done to the file's coordinates
    quality: PoseQuality
    place: tuple[float, ...]  # where on the object's surface the person is, x y z [m]
    footprint: tuple[Floats, ...] = ()  # [K, 2] corners x, z [m] of outlines that the object covers of the floor
    volume: skeleton_pb2.Volume | None = None  # the object, for bodies to keep out of; sent on as it came
    alternatives: tuple["GoalPose", ...] = ()  # the next best, best first, when more than one were asked for

    @classmethod
    def from_message(
        cls, message: goal_pose_pb2.GoalPose, *, skeleton: Skeleton, object_to_world: npt.ArrayLike
    ) -> Self:
        """Decodes; WireError when the arrays do not fit the skeleton."""
        count = skeleton.joint_count
        others = [
            cls.from_message(other, skeleton=skeleton, object_to_world=object_to_world)
            for other in message.alternatives
        ]
        footprint = outlines_from_messages(message.footprint)
        volume = message.volume if message.HasField("volume") else None
        return cls(
            name=message.name,
            skeleton=skeleton,
            root_position=unpack_floats(message.pose.root_position, (3,), field="root_position"),
            rotations=unpack_floats(message.pose.rotations, (count, 4), field="rotations"),
            joint_positions=unpack_floats(message.joint_positions, (count, 3), field="joint_positions"),
            energies=dict(message.energies),
            diagnostics=dict(message.diagnostics),
            warnings=warnings_from_messages(list(message.warnings)),
            object=message.object,
            reference_pose=message.reference_pose,
            action=action_from_message(message.action),
            floor_height=message.floor_height,
            object_to_world=np.asarray(object_to_world, np.float64),
            quality=PoseQuality.from_message(message.quality),
            place=tuple(message.place),
            footprint=footprint,
            volume=volume,
            alternatives=tuple(
                replace(
                    other,
                    object=message.object,
                    floor_height=message.floor_height,
                    footprint=footprint,
                    volume=volume,
                )
                for other in others
            ),
        )

    @property
    def pose(self) -> Pose:
        """The bare pose."""
        return Pose(self.skeleton.id, self.root_position, self.rotations)

    @property
    def heading(self) -> float:
        """Where the hips face on the floor: yaw about +Y [rad]; 0 faces +Z."""
        x, y, z, w = (float(value) for value in self.rotations[0])
        return float(np.arctan2(2 * (x * z + y * w), 1 - 2 * (x * x + y * y)))

    @property
    def goal_message(self) -> motion_pb2.Goal:
        """This pose as the goal of a motion session, with its object to walk round and to keep out of."""
        obstacles = [skeleton_pb2.Outline(corners=corners.ravel().tolist()) for corners in self.footprint]
        return motion_pb2.Goal(
            goal_pose=self.name,
            pose=self.pose.message,
            action=self.action.message,
            obstacles=obstacles,
            volume=self.volume,
        )

    def arrays(self) -> dict[str, Any]:
        """What is saved; other tools rely on these names."""
        return {
            "joint_names": np.array(self.skeleton.joint_names),
            "parents": np.array(self.skeleton.parents, np.int32),
            "root_position": self.root_position,
            "rotations": self.rotations,
            "joint_positions": self.joint_positions,
            "object_to_world": self.object_to_world,
            "floor_height": np.float64(self.floor_height),
            "action": np.int32(self.action),
        }

    def save(self, path: str | Path) -> None:
        """Writes .npz or .json; FormatError for another ending."""
        extra = {
            "name": self.name,
            "object": self.object,
            "reference_pose": self.reference_pose,
            "energies": self.energies,
            "diagnostics": self.diagnostics,
            "quality": asdict(self.quality),
        }
        save_arrays(Path(path), self.arrays(), extra)


@dataclass(frozen=True, eq=False)
class ReferencePose:
    """A pose with the object it was made for; what the optimisation adapts."""

    name: str  # "referencePoses/{id}"
    title: str
    action: Action
    pose: Pose
    object_points: Floats | None  # [N, 3] [m]; only when asked for

    @classmethod
    def from_message(cls, message: goal_pose_pb2.ReferencePose) -> Self:
        """Decodes."""
        points = message.object_points
        return cls(
            name=message.name,
            title=message.title,
            action=action_from_message(message.action),
            pose=Pose.from_message(message.pose),
            object_points=unpack_floats(points, (-1, 3), field="object_points") if points else None,
        )

    @property
    def id(self) -> str:
        """The name without its collection: chair_sit, sofa_sit, …"""
        return self.name.removeprefix("referencePoses/")


def synthesize_request(
    object: Object | str,
    *,
    reference: str | None = None,
    action: Action = Action.SIT,
    restarts: int = 0,
    seed: int = 0,
    initial_yaw: float | None = None,
    solver: str = "",
    count: int = 1,
    wishes: PoseWishes | None = None,
) -> goal_pose_pb2.SynthesizeRequest:
    """The request for one goal pose; `reference` is an id or a full name and wins over `action`."""
    wishes = wishes or PoseWishes()
    name = reference if reference is None or reference.startswith("referencePoses/") else f"referencePoses/{reference}"
    return goal_pose_pb2.SynthesizeRequest(
        object=object if isinstance(object, str) else object.name,
        reference_pose=name or "",
        action=action.message,
        restarts=restarts,
        seed=seed,
        initial_yaw=initial_yaw,
        solver=solver,
        count=count,
        constraints=wishes.constraints,
        weights=wishes.weights,
        skeleton=wishes.skeleton.message if wishes.skeleton is not None else None,
    )


def create_reference_request(
    object: Object | str, pose: Pose, *, action: Action, title: str
) -> goal_pose_pb2.CreateReferencePoseRequest:
    """The request that makes a pose on an uploaded object a reference."""
    return goal_pose_pb2.CreateReferencePoseRequest(
        object=object if isinstance(object, str) else object.name,
        pose=pose.message,
        action=action.message,
        title=title,
    )
