"""JSON of the goal pose service: what HTTP gives. Arrays are nested lists; metres, radians, xyzw."""

from base64 import b64encode
from datetime import datetime
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, Field
from roam.v1 import goal_pose_pb2, skeleton_pb2
from roam_serving.error_replies.problems import problem

from roam_goalpose.api.messages import ACTIONS, goal_pose_message, progress_message
from roam_goalpose.api.request_schemas import SkeletonJson, rows
from roam_goalpose.service.jobs import Job

_ACTION_NAMES = {number: name for name, number in ACTIONS.items()}


class WarningJson(BaseModel):
    """Something that did not stop the request."""

    reason: str
    message: str
    remedy: str

    @staticmethod
    def of(message: goal_pose_pb2.Warning) -> "WarningJson":
        """From the protocol."""
        return WarningJson(reason=message.reason, message=message.message, remedy=message.remedy)


class PoseJson(BaseModel):
    """A pose; can be sent back to the motion service as it is."""

    skeleton_id: str
    root_position: list[float] = Field(description="world position of the root joint [m]")
    rotations: list[list[float]] = Field(description="local rotations xyzw, one per joint")

    @staticmethod
    def of(message: skeleton_pb2.Pose) -> "PoseJson":
        """From the protocol."""
        return PoseJson(
            skeleton_id=message.skeleton_id,
            root_position=rows(message.root_position, 3)[0],
            rotations=rows(message.rotations, 4),
        )


class PieceJson(BaseModel):
    """One of several things in a file."""

    name: str = Field(description="of its node or group; may be empty")
    chosen: bool = Field(description="whether it is the one that was taken")
    bounds: list[list[float]] = Field(description="[2, 3] smallest and largest world coordinates [m]")


class ObjectJson(BaseModel):
    """An uploaded object."""

    name: str = Field(description="objects/sha256:…, a content hash")
    format: str
    unit: str = Field(description="of the file, given or detected")
    up_axis: str = Field(description="of the file, given or detected")
    object_to_world: list[list[float]] = Field(description="[4, 4] file coordinates to world")
    floor_height: float = Field(description="lowest point [m]")
    bounds: list[list[float]] = Field(description="[2, 3] smallest and largest world coordinates [m]")
    point_count: int
    warnings: list[WarningJson]
    pieces: list[PieceJson] = Field(default=[], description="of a file of several, in its order")

    @staticmethod
    def of(message: goal_pose_pb2.Object) -> "ObjectJson":
        """From the protocol."""
        return ObjectJson(
            name=message.name,
            format=message.format,
            unit=message.unit,
            up_axis=message.up_axis,
            object_to_world=np.array(message.object_to_world).reshape(4, 4).tolist(),
            floor_height=message.floor_height,
            bounds=[list(message.bounds_min), list(message.bounds_max)],
            point_count=message.point_count,
            warnings=[WarningJson.of(warning) for warning in message.warnings],
            pieces=[
                PieceJson(name=p.name, chosen=p.chosen, bounds=[list(p.bounds_min), list(p.bounds_max)])
                for p in message.pieces
            ],
        )


class BonePenetrationJson(BaseModel):
    """How deep one bone's capsule lies in the object."""

    bone: str
    depth: float = Field(description="[m]")
    volume: float = Field(description="[m³]")


class PoseQualityJson(BaseModel):
    """How good a pose is, measured with the stand-in body."""

    descriptor_residual: float | None = Field(description="difference from the reference's; null without the term")
    penetration_depth: float = Field(description="of the deepest capsule [m]")
    penetration_volume: float = Field(description="[m³]")
    bone_penetrations: list[BonePenetrationJson]
    hip_seat_distance: float = Field(description="height of the hips over the seat against the reference's [m]")
    contacts_met: float = Field(description="share of the reference's contacts")
    floor_distance: float | None = Field(description="of the worse sole [m]; null where the reference's feet hang")
    joint_limit_use: float = Field(description="of the most bent joint; 1 is the limit")

    @staticmethod
    def of(message: goal_pose_pb2.PoseQuality) -> "PoseQualityJson":
        """From the protocol."""
        return PoseQualityJson(
            descriptor_residual=message.descriptor_residual if message.HasField("descriptor_residual") else None,
            penetration_depth=message.penetration_depth,
            penetration_volume=message.penetration_volume,
            bone_penetrations=[
                BonePenetrationJson(bone=bone.bone, depth=bone.depth, volume=bone.volume)
                for bone in message.bone_penetrations
            ],
            hip_seat_distance=message.hip_seat_distance,
            contacts_met=message.contacts_met,
            floor_distance=message.floor_distance if message.HasField("floor_distance") else None,
            joint_limit_use=message.joint_limit_use,
        )


class RankedPoseJson(BaseModel):
    """A pose on the object and how good it is."""

    reference_pose: str
    action: str
    pose: PoseJson
    joint_positions: list[list[float]] = Field(description="world joint positions [m]")
    energies: dict[str, float] = Field(description="every term, weighted, and their sum as total")
    diagnostics: dict[str, float] = Field(description="further measures; see proto/README.md")
    quality: PoseQualityJson
    place: list[float] = Field(description="where on the object's surface the person is [m]")
    warnings: list[WarningJson]

    @staticmethod
    def of(message: goal_pose_pb2.GoalPose) -> "RankedPoseJson":
        """From the protocol."""
        return RankedPoseJson(
            reference_pose=message.reference_pose,
            action=_ACTION_NAMES[message.action],
            pose=PoseJson.of(message.pose),
            joint_positions=rows(message.joint_positions, 3),
            energies=dict(message.energies),
            diagnostics=dict(message.diagnostics),
            quality=PoseQualityJson.of(message.quality),
            place=list(message.place),
            warnings=[WarningJson.of(warning) for warning in message.warnings],
        )


class VolumeJson(BaseModel):
    """Where an object's matter is, coarsely; to be sent on as a goal's volume."""

    origin: list[float] = Field(description="node (0, 0, 0), world x y z [m]")
    pitch: float = Field(description="distance between nodes [m]")
    yaw: float = Field(description="heading of the grid's z axis about +Y [rad]")
    size: list[int] = Field(description="nodes along the grid's x, y and z axes")
    values: str = Field(description="base64 of int8 [x, y, z]: signed distance in steps of 2.5 mm, negative inside")

    @staticmethod
    def of(message: skeleton_pb2.Volume) -> "VolumeJson":
        """From the protocol."""
        return VolumeJson(
            origin=list(message.origin),
            pitch=message.pitch,
            yaw=message.yaw,
            size=list(message.size),
            values=b64encode(message.values).decode(),
        )


class GoalPoseJson(RankedPoseJson):
    """An answer: the best pose, and others where more were asked for."""

    name: str = Field(description="goalPoses/sha256:…")
    object: str
    floor_height: float = Field(description="the floor that the pose stands on [m]")
    footprint: list[list[tuple[float, float]]] = Field(
        description="corners x, z [m] of what the object covers of the floor; send it on as a goal's obstacles"
    )
    volume: VolumeJson = Field(description="the object for bodies to keep out of; send it on as a goal's volume")
    alternatives: list[RankedPoseJson] = Field(description="the next best, best first")
    skeleton: SkeletonJson | None = Field(description="of the poses, when the request brought its own")

    @staticmethod
    def of(message: goal_pose_pb2.GoalPose) -> "GoalPoseJson":
        """From the protocol."""
        best = RankedPoseJson.of(message)
        return GoalPoseJson(
            **{name: getattr(best, name) for name in RankedPoseJson.model_fields},
            name=message.name,
            object=message.object,
            floor_height=message.floor_height,
            footprint=[list(zip(o.corners[::2], o.corners[1::2], strict=True)) for o in message.footprint],
            volume=VolumeJson.of(message.volume),
            alternatives=[RankedPoseJson.of(other) for other in message.alternatives],
            skeleton=SkeletonJson.of(message.skeleton) if message.HasField("skeleton") else None,
        )


class ProgressJson(BaseModel):
    """One progress event of the stream."""

    stage: int
    stage_name: str
    iteration: int
    iteration_count: int
    energy: float
    pose: PoseJson | None

    @staticmethod
    def of(message: goal_pose_pb2.Progress) -> "ProgressJson":
        """From the protocol."""
        return ProgressJson(
            stage=message.stage,
            stage_name=message.stage_name,
            iteration=message.iteration,
            iteration_count=message.iteration_count,
            energy=message.energy,
            pose=PoseJson.of(message.pose) if message.HasField("pose") else None,
        )


class JobJson(BaseModel):
    """A synthesis that runs by itself."""

    name: str = Field(description="jobs/…")
    state: Literal["running", "succeeded", "failed"]
    created: datetime
    progress: ProgressJson | None = Field(description="the newest, while it runs")
    goal_pose: GoalPoseJson | None = Field(description="when it succeeded")
    error: dict[str, Any] | None = Field(description="a problem document, when it failed")

    @staticmethod
    def of(job: Job) -> "JobJson":
        """As it stands now."""
        return JobJson(
            name=job.name,
            state=job.state.value,
            created=job.created,
            progress=None if job.progress is None else ProgressJson.of(progress_message(job.progress)),
            goal_pose=None if job.goal_pose is None else GoalPoseJson.of(goal_pose_message(job.goal_pose)),
            error=None if job.error is None else problem(job.error),
        )


class ReferencePoseJson(BaseModel):
    """A pose with the object it was made for."""

    name: str
    title: str
    action: str
    pose: PoseJson
    object_points: list[list[float]] | None = Field(description="surface of the reference object [m], when asked for")

    @staticmethod
    def of(message: goal_pose_pb2.ReferencePose) -> "ReferencePoseJson":
        """From the protocol."""
        return ReferencePoseJson(
            name=message.name,
            title=message.title,
            action=_ACTION_NAMES[message.action],
            pose=PoseJson.of(message.pose),
            object_points=rows(message.object_points, 3) if message.object_points else None,
        )


class ReferencePosesJson(BaseModel):
    """All reference poses."""

    reference_poses: list[ReferencePoseJson]
