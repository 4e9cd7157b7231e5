"""Boxes of furniture for the tests of the motion domain, and a lying pose in the middle of a bed."""

from functools import cache

import numpy as np
import torch
from roam_character.pose import Pose, rest_pose
from roam_character.rotation import quat_from_rotvec
from roam_character.skeleton import humanoid_skeleton
from roam_character.volume import STEP, Volume
from roam_motion.animation.collision import furniture_of
from roam_motion.control.intent import Goal

NAMES = humanoid_skeleton()
PITCH = 0.04  # [m]
TOP = 0.45  # [m]
BED = ((-0.5, -1.0), (0.5, -1.0), (0.5, 1.1), (-0.5, 1.1))


def box(low, high, yaw=0.0, margin=0.12):
    """A volume around a box between two corners [3] [m]; exact at the nodes."""
    low, high = np.array(low, float), np.array(high, float)
    origin = low - margin
    size = np.ceil((high - low + 2 * margin) / PITCH).astype(int) + 1
    nodes = origin + PITCH * np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), -1)
    apart = np.maximum(low - nodes, nodes - high)
    distance = np.linalg.norm(np.maximum(apart, 0), axis=-1) + np.minimum(apart.max(-1), 0)
    values = np.clip(np.round(distance / STEP), -127, 127).astype(np.int8)
    return Volume(origin.astype(np.float32), PITCH, yaw, values)


def lying_pose():
    """On the back, feet towards +Z, arms beside the body."""
    rotations = rest_pose(NAMES).rotations.copy()
    rotations[0] = quat_from_rotvec(np.array([-np.pi / 2, 0, 0], np.float32))
    for side, sign in (("left", -1), ("right", 1)):
        rotations[NAMES.index(f"{side}UpperArm")] = quat_from_rotvec(np.array([0, 0, sign * 1.35], np.float32))
    return Pose(humanoid_skeleton(), np.array([0, TOP + 0.10, 0], np.float32), rotations)


@cache
def bed(wall=None):
    """A goal on a bed of 1 x 2.1 m, with a board along one of its sides if asked."""
    volume = box([-0.5, 0.0, -1.0], [0.5, TOP, 1.1])
    if wall is not None:
        low, high = (
            ([0.46, 0.0, -1.0], [0.5, TOP + 0.4, 1.1]) if wall == "left" else ([-0.5, 0, -1], [-0.46, 0.85, 1.1])
        )
        board = box(low, high)
        volume = box([-0.5, 0.0, -1.0], [0.5, TOP + 0.4, 1.1])
        nodes = volume.origin + volume.pitch * np.stack(
            np.meshgrid(*map(np.arange, volume.values.shape), indexing="ij"), -1
        )
        flat = torch.tensor(nodes.reshape(1, -1, 3), dtype=torch.float32)
        parts = [box([-0.5, 0.0, -1.0], [0.5, TOP, 1.1]), board]
        gaps = [furniture_of([part], [np.zeros(0, np.float32)], [True]).distance(flat)[0] for part in parts]
        values = (torch.minimum(*gaps) / 0.0025).round().clamp(-127, 127).reshape(volume.values.shape)
        volume = type(volume)(volume.origin, volume.pitch, 0.0, values.numpy().astype(np.int8))
    return Goal(lying_pose(), "lie", obstacles=(BED,), volume=volume)
