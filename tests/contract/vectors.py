"""The golden vectors: messages whose bytes every client must read alike. Running this file writes them.

NAME.bin holds the bytes of one message; NAME.json says its type, its plain fields and its arrays as numbers.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from google.protobuf import json_format
from google.protobuf.message import Message
from roam.v1 import goal_pose_pb2, motion_pb2, skeleton_pb2

FOLDER = Path(__file__).parents[2] / "proto" / "golden"
JOINTS = 3  # hips, spine, head: small enough to read, large enough to show the layout
SKELETON_ID = "sha256:" + "0123456789abcdef" * 4

# Exactly representable, so that a float32 reader compares with ==.
ROTATIONS = np.array([[0, 0, 0, 1], [0, 1, 0, 0], [0.5, -0.5, 0.5, 0.5]], "<f4")
OFFSETS = np.array([[0, 0.875, 0], [0, 0.25, 0.0625], [0, 0.5, -0.125]], "<f4")
POSITION = np.array([1.5, 0.875, -2.25], "<f4")


@dataclass(frozen=True)
class Vector:
    """One message, and how to read its byte fields: path → (numpy type, shape)."""

    message: Message
    arrays: dict[str, tuple[str, tuple[int, ...]]]


def snorm16(rotations: np.ndarray) -> bytes:
    """int16 scaled by 32767, as proto/README.md says."""
    return np.rint(rotations * 32767).astype("<i2").tobytes()


def skeleton() -> skeleton_pb2.Skeleton:
    return skeleton_pb2.Skeleton(
        id=SKELETON_ID,
        joint_names=["hips", "spine", "head"],
        parents=[-1, 0, 1],
        rest_offsets=OFFSETS.tobytes(),
        rest_rotations=np.tile(np.array([0, 0, 0, 1], "<f4"), (JOINTS, 1)).tobytes(),
        humanoid_bones=["hips", "spine", "head"],
        tips=[skeleton_pb2.Tip(name="headTop", joint=2, offset=[0, 0.25, 0])],
    )


def pose() -> skeleton_pb2.Pose:
    return skeleton_pb2.Pose(skeleton_id=SKELETON_ID, root_position=POSITION.tobytes(), rotations=ROTATIONS.tobytes())


def frame(rotations: bytes) -> motion_pb2.Frame:
    return motion_pb2.Frame(
        sequence=90,
        time=3.0,
        root=np.concatenate([POSITION, ROTATIONS[0]]).tobytes(),
        rotations=rotations,
        contacts=0b0101,
        action=skeleton_pb2.ACTION_WALK,
        goal_distance=0.75,
    )


_POSE_ARRAYS = {"root_position": ("<f4", (3,)), "rotations": ("<f4", (JOINTS, 4))}


def _under(path: str) -> dict[str, tuple[str, tuple[int, ...]]]:
    return {f"{path}.{name}": how for name, how in _POSE_ARRAYS.items()}


def frame_vectors() -> dict[str, Vector]:
    root = {"frame.root": ("<f4", (7,))}
    float32 = frame(ROTATIONS.tobytes())
    float32.joint_positions = (OFFSETS + POSITION).astype("<f4").tobytes()
    return {
        "frame_float32": Vector(
            motion_pb2.AnimateResponse(frame=float32),
            root | {"frame.rotations": ("<f4", (JOINTS, 4)), "frame.joint_positions": ("<f4", (JOINTS, 3))},
        ),
        "frame_snorm16": Vector(
            motion_pb2.AnimateResponse(frame=frame(snorm16(ROTATIONS))),
            root | {"frame.rotations": ("<i2", (JOINTS, 4))},
        ),
    }


def stream_vectors() -> dict[str, Vector]:
    header = motion_pb2.StreamHeader(
        session="sessions/1f",
        skeleton=skeleton(),
        rotation_encoding=motion_pb2.ROTATION_ENCODING_SNORM16,
        frame_rate=30,
        first_sequence=91,
        contact_joints=[1, 2],
        resume_token="token",
        last_control_id=300,
        exact=True,
        pacing=motion_pb2.PACING_CREDIT,
    )
    event = motion_pb2.SessionEvent(
        type=motion_pb2.EVENT_TYPE_GOAL_REACHED, sequence=195, message="there", goal_pose="goalPoses/x"
    )
    response = motion_pb2.AnimateResponse(event=event)
    response.echo_client_time.seconds, response.echo_client_time.nanos = 1_700_000_000, 250_000_000
    arrays = {
        "header.skeleton.rest_offsets": ("<f4", (JOINTS, 3)),
        "header.skeleton.rest_rotations": ("<f4", (JOINTS, 4)),
    }
    return {
        "stream_header": Vector(motion_pb2.AnimateResponse(header=header), arrays),
        "event_goal_reached": Vector(response, {}),
    }


def request_vectors() -> dict[str, Vector]:
    opening = motion_pb2.Open(
        session="sessions/1f",
        after_sequence=90,
        resume_token="token",
        known_skeleton_id=SKELETON_ID,
        rotation_encodings=[motion_pb2.ROTATION_ENCODING_SNORM16, motion_pb2.ROTATION_ENCODING_FLOAT32],
        pacing=motion_pb2.PACING_CREDIT,
        credit=5,
    )
    goal = motion_pb2.Goal(goal_pose="goalPoses/x", pose=pose(), action=skeleton_pb2.ACTION_SIT)
    steer = motion_pb2.Steer(velocity_x=1.25, velocity_z=-0.5, facing=0)
    controls = {
        "control_goal": motion_pb2.ControlInput(goal=goal, control_id=1),
        "control_steer": motion_pb2.ControlInput(steer=steer, control_id=200),
        "control_pause": motion_pb2.ControlInput(playback=motion_pb2.Playback(paused=True), control_id=201),
    }
    found = {"open": Vector(motion_pb2.AnimateRequest(open=opening), {})}
    for name, control in controls.items():
        arrays = _under("control.goal.pose") if name == "control_goal" else {}
        found[name] = Vector(motion_pb2.AnimateRequest(control=control), arrays)
    found["ack"] = Vector(motion_pb2.AnimateRequest(ack=motion_pb2.Ack(sequence=90, credit=1)), {})
    return found


def goal_pose_vectors() -> dict[str, Vector]:
    positions = (OFFSETS + POSITION).astype("<f4").tobytes()
    goal_pose = goal_pose_pb2.GoalPose(
        name="goalPoses/x",
        pose=pose(),
        energies={"descriptor": 0.5, "total": 0.75},
        diagnostics={"penetration_depth": 0.0625},
        warnings=[goal_pose_pb2.Warning(reason="DEEP_PENETRATION", message="It cuts.", remedy="Look at it.")],
        object="objects/y",
        reference_pose="referencePoses/chair_sit",
        action=skeleton_pb2.ACTION_SIT,
        joint_positions=positions,
        floor_height=-0.125,
        quality=goal_pose_pb2.PoseQuality(
            penetration_depth=0.0625,
            penetration_volume=0.0009765625,
            bone_penetrations=[goal_pose_pb2.BonePenetration(bone="hips", depth=0.0625, volume=0.0009765625)],
            hip_seat_distance=0.015625,
            contacts_met=0.75,
            floor_distance=0.0,  # measured, and 0: sent, because absent means something else
            joint_limit_use=0.5,
        ),
        place=[1.5, 0.75, -2.25],
        alternatives=[
            goal_pose_pb2.GoalPose(pose=pose(), joint_positions=(OFFSETS + POSITION).astype("<f4").tobytes())
        ],
    )
    request = goal_pose_pb2.SynthesizeRequest(
        object="objects/y",
        action=skeleton_pb2.ACTION_SIT,
        seed=0,
        count=2,
        constraints=goal_pose_pb2.PoseConstraints(
            seat_point=[1.5, 0.75, -2.25],
            facing=0.0,
            hand_targets=[goal_pose_pb2.HandTarget(hand=goal_pose_pb2.HAND_RIGHT, position=[1.25, 1.0, -2.0])],
        ),
        weights={"descriptor": 0.0},
        skeleton=skeleton(),
    )
    transform = np.diag([0.01, 0.01, 0.01, 1.0]).ravel().tolist()
    found = goal_pose_pb2.Object(
        name="objects/y",
        format="obj",
        unit="cm",
        up_axis="y",
        object_to_world=transform,
        floor_height=-0.125,
        bounds_min=[-0.25, -0.125, -0.25],
        bounds_max=[0.25, 0.875, 0.25],
        point_count=20000,
        warnings=[goal_pose_pb2.Warning(reason="OBJECT_UNIT_UNSURE", message="Centimetres were guessed.")],
    )
    progress = goal_pose_pb2.Progress(
        stage=2, stage_name="joints", iteration=30, iteration_count=100, energy=0.5, pose=pose()
    )
    arrays = _under("goal_pose.pose") | {"goal_pose.joint_positions": ("<f4", (JOINTS, 3))}
    own = {"skeleton.rest_offsets": ("<f4", (JOINTS, 3)), "skeleton.rest_rotations": ("<f4", (JOINTS, 4))}
    return {
        "synthesize": Vector(request, own),
        "goal_pose": Vector(goal_pose_pb2.SynthesizeResponse(goal_pose=goal_pose), arrays),
        "progress": Vector(goal_pose_pb2.SynthesizeResponse(progress=progress), _under("progress.pose")),
        "object": Vector(goal_pose_pb2.UploadObjectResponse(object=found), {}),
    }


def vectors() -> dict[str, Vector]:
    """All vectors by name."""
    return frame_vectors() | stream_vectors() | request_vectors() | goal_pose_vectors()


def field_at(message: Message, path: str) -> bytes:
    """A byte field by its path."""
    value: object = message
    for name in path.split("."):
        value = getattr(value, name)
    assert isinstance(value, bytes)
    return value


def description(vector: Vector) -> dict[str, object]:
    """What NAME.json says."""
    arrays = {}
    for path, (kind, shape) in vector.arrays.items():
        values = np.frombuffer(field_at(vector.message, path), kind).reshape(shape)
        arrays[path] = {
            "type": {"<f4": "float32", "<i2": "int16"}[kind],
            "shape": list(shape),
            "values": values.tolist(),
        }
    fields = json_format.MessageToDict(vector.message, preserving_proto_field_name=True)
    return {"message": vector.message.DESCRIPTOR.full_name, "fields": fields, "arrays": arrays}


def main() -> None:
    """Writes every vector."""
    FOLDER.mkdir(exist_ok=True)
    for name, vector in vectors().items():
        (FOLDER / f"{name}.bin").write_bytes(vector.message.SerializeToString(deterministic=True))
        (FOLDER / f"{name}.json").write_text(json.dumps(description(vector), indent=1) + "\n")


if __name__ == "__main__":
    main()
