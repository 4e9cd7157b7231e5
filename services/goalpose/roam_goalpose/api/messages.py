"""Between the protocol's messages and this service's own types."""

from collections.abc import Iterable, Mapping

import numpy as np
from roam.v1 import goal_pose_pb2, skeleton_pb2
from roam_character.body import body_capsules
from roam_character.pose import Pose
from roam_character.volume import Volume
from roam_character.wire import pack_float32
from roam_serving.endpoints.skeletons import skeleton_message

from roam_goalpose.assessment.diagnostics import PoseWarning
from roam_goalpose.assessment.quality import PoseQuality
from roam_goalpose.objects.footprint import footprint
from roam_goalpose.objects.placing.axes import ROTATIONS
from roam_goalpose.references.pairs import ACTIONS as NAMES
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.service.queries import GoalPose, StoredObject
from roam_goalpose.solvers.progress import Progress
from roam_goalpose.synthesis import RankedPose

ACTIONS = {name: skeleton_pb2.Action.Value(f"ACTION_{name.upper()}") for name in NAMES}
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


def pose_message(pose: Pose) -> skeleton_pb2.Pose:
    """A pose as the protocol tells it."""
    return skeleton_pb2.Pose(
        skeleton_id=pose.skeleton.id,
        root_position=pack_float32(pose.root_position),
        rotations=pack_float32(pose.rotations),
    )


def unit_of(object_to_world: np.ndarray) -> str:
    """The unit whose size the transform has; "" for a scale that is no unit."""
    scale = float(np.cbrt(abs(np.linalg.det(object_to_world[:3, :3]))))
    return next((name for name, size in UNITS.items() if abs(scale / size - 1) < 1e-6), "")


def up_axis_of(object_to_world: np.ndarray) -> str:
    """The file's axis that the transform turns to +Y; "" when it is none of the six."""
    up = np.linalg.solve(object_to_world[:3, :3], np.array([0.0, 1.0, 0.0]))
    up /= np.linalg.norm(up)
    names = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}
    assert names.keys() == ROTATIONS.keys()
    return next((name for name, axis in names.items() if np.dot(up, axis) > 1 - 1e-6), "")


def object_message(stored: StoredObject) -> goal_pose_pb2.Object:
    """What GetObject tells."""
    shape = stored.shape
    return goal_pose_pb2.Object(
        name=shape.name,
        format=stored.format,
        unit=unit_of(shape.object_to_world),
        up_axis=up_axis_of(shape.object_to_world),
        object_to_world=shape.object_to_world.ravel().tolist(),
        floor_height=shape.floor_height,
        bounds_min=shape.bounds[0].tolist(),
        bounds_max=shape.bounds[1].tolist(),
        point_count=len(shape.points),
        warnings=[goal_pose_pb2.Warning(reason=w.reason, message=w.message) for w in shape.warnings],
        footprint=outline_messages(footprint(shape.points)),
        pieces=[
            goal_pose_pb2.Piece(name=p.name, chosen=p.chosen, bounds_min=p.bounds[:3], bounds_max=p.bounds[3:])
            for p in shape.pieces
        ],
    )


def outline_messages(outlines: Iterable[np.ndarray]) -> list[skeleton_pb2.Outline]:
    """What an object covers of the floor, from corners [K, 2] [m]."""
    return [skeleton_pb2.Outline(corners=corners.ravel().tolist()) for corners in outlines]


def volume_message(volume: Volume) -> skeleton_pb2.Volume:
    """The object for bodies to keep out of."""
    return skeleton_pb2.Volume(
        origin=volume.origin.tolist(),
        pitch=volume.pitch,
        yaw=volume.yaw,
        size=volume.values.shape,
        values=volume.values.tobytes(),
    )


def reference_message(pair: ReferencePair, *, include_points: bool) -> goal_pose_pb2.ReferencePose:
    """What ListReferencePoses tells of one pair."""
    return goal_pose_pb2.ReferencePose(
        name=f"referencePoses/{pair.id}",
        title=pair.title,
        action=ACTIONS[pair.action],
        pose=pose_message(pair.pose),
        object_points=pack_float32(pair.shape.points) if include_points else b"",
    )


def progress_message(progress: Progress) -> goal_pose_pb2.Progress:
    """A step of the optimisation."""
    return goal_pose_pb2.Progress(
        stage=progress.stage,
        iteration=progress.iteration,
        iteration_count=progress.iteration_count,
        energy=progress.energy,
        pose=pose_message(progress.pose) if progress.pose is not None else None,
        stage_name=progress.stage_name,
    )


def goal_pose_message(goal_pose: GoalPose) -> goal_pose_pb2.GoalPose:
    """An answer: the best pose, then the others."""
    result = goal_pose.result
    ranked = zip(result.poses, goal_pose.qualities, strict=True)
    message, *others = [_ranked_message(pose, quality) for pose, quality in ranked]
    message.name = result.name
    message.object = result.object
    message.floor_height = result.floor_height
    message.alternatives.extend(others)
    message.footprint.extend(outline_messages(goal_pose.outlines))
    message.volume.CopyFrom(volume_message(goal_pose.volume))
    if goal_pose.skeleton is not None:
        own = skeleton_message(goal_pose.skeleton, body_capsules(goal_pose.skeleton))
        message.skeleton.CopyFrom(own.skeleton)
    return message


def _ranked_message(ranked: RankedPose, quality: PoseQuality) -> goal_pose_pb2.GoalPose:
    return goal_pose_pb2.GoalPose(
        pose=pose_message(ranked.pose),
        energies=_plain(ranked.energies),
        diagnostics=_plain(ranked.diagnostics),
        warnings=[_warning(warning) for warning in ranked.warnings],
        reference_pose=f"referencePoses/{ranked.reference}",
        action=ACTIONS[ranked.action],
        joint_positions=pack_float32(ranked.pose.positions()),
        quality=quality_message(quality),
        place=ranked.place,
    )


def _plain(values: Mapping[str, float]) -> dict[str, float]:
    return {key: float(value) for key, value in values.items()}


def _warning(warning: PoseWarning) -> goal_pose_pb2.Warning:
    return goal_pose_pb2.Warning(reason=warning.reason, message=warning.message, remedy=warning.remedy)


def quality_message(quality: PoseQuality) -> goal_pose_pb2.PoseQuality:
    """How good a pose is."""
    return goal_pose_pb2.PoseQuality(
        descriptor_residual=quality.descriptor_residual,
        penetration_depth=quality.penetration_depth,
        penetration_volume=quality.penetration_volume,
        bone_penetrations=[
            goal_pose_pb2.BonePenetration(bone=bone.bone, depth=bone.depth, volume=bone.volume)
            for bone in quality.penetrations
        ],
        hip_seat_distance=quality.hip_seat_distance,
        contacts_met=quality.contacts_met,
        floor_distance=quality.floor_distance,
        joint_limit_use=quality.joint_limit_use,
    )
