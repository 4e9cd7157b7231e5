"""A made-up sit that people would recognise: leaning forward over planted feet, then settling back on the seat."""

import numpy as np
from roam_character.clip import Clip
from roam_character.pose import rest_pose
from roam_character.rotation import quat_from_rotvec, quat_mul
from roam_character.skeleton import humanoid_skeleton
from roam_motion.training.data.goals import Key, ankles, with_feet

STAND, SEAT = np.array([0.0, 0.955, 0.03]), np.array([0.0, 0.57, -0.24])  # hips [m]


def leaning_clip(lean=42.0, rate=30.0):
    """Stands 2 s, sits down within 1 s with a lean of so many degrees, sits 2 s, rises within 1 s, stands 2 s."""
    skeleton, rest = humanoid_skeleton(), rest_pose(humanoid_skeleton())
    feet = ankles(skeleton, Key(rest.root_position, rest.rotations)) * np.array([1, 1, 0]) + np.array([0, 0, -0.02])
    down = np.linspace(0, 1, 30)
    share = np.concatenate([np.zeros(60), down * down * (3 - 2 * down), np.ones(60)])
    # The lean is largest at contact and gone a second later.
    forward, back = np.sin(np.pi / 2 * np.linspace(0, 1, 38)), np.cos(np.pi / 2 * down)
    bend = np.concatenate([np.zeros(50), forward, back, np.zeros(32)])
    share, bend = (np.concatenate([half, half[::-1]]) for half in (share, bend))
    hips, rotations = [], []
    for sunk, bent in zip(share, bend, strict=True):
        turns = rest.rotations.copy()
        pitch = quat_from_rotvec(np.array([np.deg2rad(lean) * bent, 0, 0], np.float32))
        turns[0] = quat_mul(pitch, turns[0])
        place = (STAND + sunk * (SEAT - STAND)).astype(np.float32)
        key = with_feet(skeleton, Key(place, turns), feet.astype(np.float32), np.zeros(2, np.float32))
        hips.append(key.hips)
        rotations.append(key.rotations)
    return Clip(skeleton, rate, np.stack(hips), np.stack(rotations).astype(np.float32))
