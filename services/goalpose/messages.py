"""Between the protocol's messages and this service's own types."""

import numpy as np
from character.pose import Pose
from character.wire import pack_float32
from roam.v1 import goal_pose_pb2, skeleton_pb2

from goalpose.objects import Shape
from goalpose.objects.axes import ROTATIONS
from goalpose.progress import Progress
from goalpose.references import ReferencePair
from goalpose.synthesis import GoalPoseResult

ACTIONS = {"sit": skeleton_pb2.ACTION_SIT, "lie": skeleton_pb2.ACTION_LIE}
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


def object_message(shape: Shape, format: str) -> goal_pose_pb2.Object:
    """What GetObject tells."""
    return goal_pose_pb2.Object(
        name=shape.name,
        format=format,
        unit=unit_of(shape.object_to_world),
        up_axis=up_axis_of(shape.object_to_world),
        object_to_world=shape.object_to_world.ravel().tolist(),
        floor_height=shape.floor_height,
        bounds_min=shape.bounds[0].tolist(),
        bounds_max=shape.bounds[1].tolist(),
        point_count=len(shape.points),
        warnings=[goal_pose_pb2.Warning(reason=w.reason, message=w.message) for w in shape.warnings],
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


def goal_pose_message(result: GoalPoseResult) -> goal_pose_pb2.GoalPose:
    """An answer."""
    return goal_pose_pb2.GoalPose(
        name=result.name,
        pose=pose_message(result.pose),
        energies={key: float(value) for key, value in result.energies.items()},
        diagnostics={key: float(value) for key, value in result.diagnostics.items()},
        warnings=[goal_pose_pb2.Warning(reason=w.reason, message=w.message, remedy=w.remedy) for w in result.warnings],
        object=result.object,
        reference_pose=f"referencePoses/{result.reference}",
        action=ACTIONS[result.action],
        joint_positions=pack_float32(result.pose.positions()),
        floor_height=result.floor_height,
    )
