"""JSON of the goal pose service: what HTTP takes. Arrays are nested lists; metres, radians, xyzw."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from roam.v1 import goal_pose_pb2, skeleton_pb2
from roam_character.wire import pack_float32

from roam_goalpose.api.messages import ACTIONS
from roam_goalpose.energy.terms import TERMS

Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]  # nothing sensible is larger, float32 holds it
Point = Annotated[list[Number], Field(min_length=3, max_length=3)]


def describe_terms(schema: dict[str, Any]) -> None:
    """Which energy terms there are, for the API's documentation: those of the registry when it is asked for."""
    schema["propertyNames"] = {"enum": list(TERMS)}
    told = "; ".join(f"{term.name} ({term.symbol}, weight {term.weight:g}): {term.equation}" for term in TERMS.values())
    schema["description"] = f"{schema['description']}. Terms: {told}"


def rows(data: bytes, width: int) -> list[list[float]]:
    """Packed float32 as nested lists [N, width]."""
    found: list[list[float]] = np.frombuffer(data, "<f4").reshape(-1, width).tolist()
    return found


class TipJson(BaseModel):
    """An end point of a limb."""

    name: str
    joint: int = Field(ge=0, lt=1 << 16, description="that carries it")
    offset: Point = Field(description="in the joint's frame [m]")


class SkeletonJson(BaseModel):
    """A person of other proportions, in the form of GET /v1/skeletons: VRM 1.0 bones, T-pose facing +Z."""

    joint_names: list[str]
    parents: list[Annotated[int, Field(ge=-1, lt=1 << 16)]] = Field(
        description="-1 for the root; before their children"
    )
    rest_offsets: list[Point] = Field(description="from the parent [m]")
    humanoid_bones: list[str] = Field(description="VRM 1.0 bone of every joint, or empty")
    tips: list[TipJson] = []

    def message(self) -> skeleton_pb2.Skeleton:
        """As the protocol tells it."""
        return skeleton_pb2.Skeleton(
            joint_names=self.joint_names,
            parents=self.parents,
            rest_offsets=pack_float32(np.array(self.rest_offsets, np.float32)),
            rest_rotations=pack_float32(np.tile(np.array([0, 0, 0, 1], np.float32), (len(self.joint_names), 1))),
            humanoid_bones=self.humanoid_bones,
            tips=[skeleton_pb2.Tip(name=tip.name, joint=tip.joint, offset=tip.offset) for tip in self.tips],
        )

    @staticmethod
    def of(message: skeleton_pb2.Skeleton) -> "SkeletonJson":
        """From the protocol."""
        return SkeletonJson(
            joint_names=list(message.joint_names),
            parents=list(message.parents),
            rest_offsets=rows(message.rest_offsets, 3),
            humanoid_bones=list(message.humanoid_bones),
            tips=[TipJson(name=tip.name, joint=tip.joint, offset=list(tip.offset)) for tip in message.tips],
        )


class HandTargetsJson(BaseModel):
    """Where the middles of the hands go [m]."""

    model_config = ConfigDict(extra="forbid")

    left: Point | None = None
    right: Point | None = None


class ConstraintsJson(BaseModel):
    """What the pose shall do besides fitting; weighed against the fit, not forced."""

    model_config = ConfigDict(extra="forbid")

    seat_point: Point | None = Field(None, description="that the hips go over [m]")
    facing: Number | None = Field(None, description="heading of the pelvis [rad]; 0 faces +Z")
    hand_targets: HandTargetsJson = HandTargetsJson()

    def message(self) -> goal_pose_pb2.PoseConstraints:
        """As the protocol tells it."""
        targets = {goal_pose_pb2.HAND_LEFT: self.hand_targets.left, goal_pose_pb2.HAND_RIGHT: self.hand_targets.right}
        return goal_pose_pb2.PoseConstraints(
            seat_point=self.seat_point or [],
            facing=self.facing,
            hand_targets=[goal_pose_pb2.HandTarget(hand=h, position=p) for h, p in targets.items() if p is not None],
        )


class SynthesizeJson(BaseModel):
    """Body of POST /v1/goal-poses: `object` or `points`, and `reference_pose` or `action`."""

    model_config = ConfigDict(extra="forbid")

    object: str = Field("", description="name from POST /v1/objects")
    points: list[Point] | None = Field(None, description="surface points [m], +Y up, instead of an object")
    reference_pose: str = Field("", description="referencePoses/{id}, or the id alone")
    action: Literal["sit", "lie"] | None = Field(None, description="let the server choose the reference pose")
    initial_yaw: Number | None = Field(None, description="first initial heading of solver=paper [rad]")
    restarts: int = Field(0, ge=0, lt=1 << 31, description="initial headings tried; 0: server default")
    seed: int = Field(0, ge=0, lt=1 << 63, description="same request, same seed, same bytes")
    solver: str = Field("", description="default or paper")
    skeleton_id: str = ""
    count: int = Field(0, ge=0, lt=1 << 31, description="poses wanted, the best and others unlike it; 0: one")
    constraints: ConstraintsJson = ConstraintsJson()
    weights: dict[str, Number] = Field(
        {},
        description="of energy terms, instead of the server's; 0 switches one off",
        json_schema_extra=describe_terms,
    )
    skeleton: SkeletonJson | None = Field(None, description="a person of other proportions, instead of skeleton_id")

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
            count=self.count,
            constraints=self.constraints.message(),
            weights=self.weights,
            skeleton=None if self.skeleton is None else self.skeleton.message(),
        )
        if self.action is not None:
            request.action = ACTIONS[self.action]
        return request


class GivenPoseJson(BaseModel):
    """A pose of the caller's own, as PoseJson tells poses."""

    skeleton_id: str = ""
    root_position: Point = Field(description="world position of the root joint [m]")
    rotations: list[Annotated[list[Number], Field(min_length=4, max_length=4)]] = Field(
        description="local rotations xyzw, one per joint"
    )


class CreateReferencePoseJson(BaseModel):
    """Body of POST /v1/reference-poses: a pose on an uploaded object, in that object's world space."""

    model_config = ConfigDict(extra="forbid")

    object: str = Field(description="name from POST /v1/objects")
    pose: GivenPoseJson
    action: Literal["sit", "lie"]
    title: str = ""

    def message(self) -> goal_pose_pb2.CreateReferencePoseRequest:
        """As the protocol tells it."""
        pose = skeleton_pb2.Pose(
            skeleton_id=self.pose.skeleton_id,
            root_position=pack_float32(np.array(self.pose.root_position, np.float32)),
            rotations=pack_float32(np.array(self.pose.rotations, np.float32)),
        )
        return goal_pose_pb2.CreateReferencePoseRequest(
            object=self.object, pose=pose, action=ACTIONS[self.action], title=self.title
        )
