"""The capsule body fits any humanoid skeleton."""

import numpy as np
from roam_character.body import body_capsules
from roam_character.pose import rest_pose
from roam_character.skeleton import load_skeleton


def test_every_humanoid_bone_has_a_capsule_and_the_body_stands_on_the_floor():
    for name in ("humanoid", "paper"):
        skeleton = load_skeleton(name)
        capsules = body_capsules(skeleton)
        assert set(capsules.names) == {bone for bone in skeleton.humanoid_bones if bone}
        starts, ends = capsules.segments(*rest_pose(skeleton).posture())
        lowest = np.minimum(starts[:, 1], ends[:, 1]) - capsules.radii
        assert -0.04 < lowest.min() < 0.03
        assert np.isfinite(starts).all()
        assert np.isfinite(ends).all()
