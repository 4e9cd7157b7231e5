"""A small walking-like clip that needs no motion-capture data."""

import numpy as np
import pytest
from roam_character.clip import Clip
from roam_character.rotation import quat_from_rotvec
from roam_character.skeleton import humanoid_skeleton


@pytest.fixture
def clip() -> Clip:
    """One second of swinging limbs moving forward at 24 Hz, [24, 22, 4]."""
    skeleton = humanoid_skeleton()
    time = np.arange(24) / 24
    vectors = np.zeros((24, skeleton.joint_count, 3))
    for name, scale in (("leftUpperLeg", 0.5), ("rightUpperLeg", -0.5), ("leftUpperArm", 0.7), ("spine", 0.1)):
        vectors[:, skeleton.index(name), 0] = scale * np.sin(2 * np.pi * time)
    vectors[:, skeleton.index("leftLowerLeg"), 0] = 0.4 + 0.3 * np.cos(2 * np.pi * time)
    vectors[:, 0, 1] = 0.5 * time
    roots = np.stack([0.1 * time, 0.93 + 0.02 * np.sin(4 * np.pi * time), 1.2 * time], axis=-1)
    return Clip(skeleton, 24.0, roots.astype(np.float32), quat_from_rotvec(vectors).astype(np.float32))
