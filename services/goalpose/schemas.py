"""JSON of the goal pose service: what HTTP takes and gives. Arrays are nested lists; metres, radians, xyzw."""

from datetime import datetime
from typing import Annotated, Any, Literal

import numpy as np
from character.wire import pack_float32
from pydantic import BaseModel, ConfigDict, Field
from roam.v1 import goal_pose_pb2, skeleton_pb2
from serving.problems import problem

from goalpose.jobs import Job
from goalpose.messages import ACTIONS, progress_message

Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]  # nothing sensible is larger, float32 holds it
Point = Annotated[list[Number], Field(min_length=3, max_length=3)]

_ACTION_NAMES = {number: name for name, number in ACTIONS.items()}


def _rows(data: bytes, width: int) -> list[list[float]]:
    rows: list[list[float]] = np.frombuffer(data, "<f4").reshape(-1, width).tolist()
    return rows


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
            root_position=_rows(message.root_position, 3)[0],
            rotations=_rows(message.rotations, 4),
        )


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
        )


class SynthesizeJson(BaseModel):
    """Body of POST /v1/goal-poses: `object` or `points`, and `reference_pose` or `action`."""

    model_config = ConfigDict(extra="forbid")

    object: str = Field("", description="name from POST /v1/objects")
    points: list[Point] | None = Field(None, description="surface points [m], +Y up, instead of an object")
    reference_pose: str = Field("", description="referencePoses/{id}, or the id alone")
    action: Literal["sit", "lie"] | None = Field(None, description="let the server choose the reference pose")
    initial_yaw: Number | None = Field(None, description="first initial heading [rad]")
    restarts: int = Field(0, ge=0, lt=1 << 31, description="initial headings tried; 0: server default")
    seed: int = Field(0, ge=0, lt=1 << 63, description="same request, same seed, same bytes")
    solver: str = Field("", description="default or paper")
    skeleton_id: str = ""

    def message(self) -> goal_pose_pb2.SynthesizeRequest:
        """As the protocol tells it."""
        request = goal_pose_pb2.SynthesizeRequest(
            object=self.object,
            points=pack_float32(np.array(self.points, np.float32)) if self.points else b"",
            reference_pose=self.reference_pose,
            restarts=self.restarts,
            seed=self.seed,
            initial_yaw=self.initial_yaw,
            solver=self.solver,
            skeleton_id=self.skeleton_id,
        )
        if self.action is not None:
            request.action = ACTIONS[self.action]
        return request


class GoalPoseJson(BaseModel):
    """An answer."""

    name: str = Field(description="goalPoses/sha256:…")
    object: str
    reference_pose: str
    action: str
    pose: PoseJson
    joint_positions: list[list[float]] = Field(description="world joint positions [m]")
    energies: dict[str, float] = Field(description="every term, weighted, and their sum as total")
    diagnostics: dict[str, float] = Field(description="how good the pose is; see proto/README.md")
    floor_height: float = Field(description="the floor that the pose stands on [m]")
    warnings: list[WarningJson]

    @staticmethod
    def of(message: goal_pose_pb2.GoalPose) -> "GoalPoseJson":
        """From the protocol."""
        return GoalPoseJson(
            name=message.name,
            object=message.object,
            reference_pose=message.reference_pose,
            action=_ACTION_NAMES[message.action],
            pose=PoseJson.of(message.pose),
            joint_positions=_rows(message.joint_positions, 3),
            energies=dict(message.energies),
            diagnostics=dict(message.diagnostics),
            floor_height=message.floor_height,
            warnings=[WarningJson.of(warning) for warning in message.warnings],
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
            goal_pose=None if job.goal_pose is None else GoalPoseJson.of(job.goal_pose),
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
            object_points=_rows(message.object_points, 3) if message.object_points else None,
        )


class ReferencePosesJson(BaseModel):
    """All reference poses."""

    reference_poses: list[ReferencePoseJson]
