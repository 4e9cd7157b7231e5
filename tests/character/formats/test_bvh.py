"""BVH files: what is written is read back, and broken files say what is wrong."""

import numpy as np
import pytest
from roam_character.documents.bvh import BvhError, read_bvh, write_bvh


def test_round_trip(clip, tmp_path):
    write_bvh(tmp_path / "a.bvh", clip)
    back = read_bvh(tmp_path / "a.bvh")
    order = [back.skeleton.index(name) for name in clip.skeleton.joint_names]
    assert back.frame_rate == 24.0
    assert np.allclose(back.positions()[:, order], clip.positions(), atol=1e-4)


def test_channel_order_is_obeyed(tmp_path):
    text = """HIERARCHY
ROOT hips
{ OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
  End Site
  { OFFSET 0 0 1 }
}
MOTION
Frames: 1
Frame Time: 0.0333333
1 2 3 90 90 0
"""
    path = tmp_path / "b.bvh"
    path.write_text(text)
    clip = read_bvh(path, unit=1.0)
    assert np.allclose(clip.root_positions, [[1, 2, 3]])
    # Ry(90) Rx(90): +Z turns down about X, and down stays down about Y.
    assert np.allclose(clip.pose(0).tips(), [[1, 1, 3]], atol=1e-6)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda t: t.replace("HIERARCHY", "NOTHING"), "HIERARCHY"),
        (lambda t: t.split("MOTION")[0], "MOTION"),
        (lambda t: t + "1 2 3\n", "multiple of"),
        (lambda t: t.replace("Zrotation", "Wrotation"), "Wrotation"),
        (lambda t: t.replace("Frame Time: 0.0", "Frame Time: -0.0"), "Frame Time"),
    ],
)
def test_broken_files_name_the_file_and_the_reason(clip, tmp_path, damage, reason):
    path = tmp_path / "broken.bvh"
    write_bvh(path, clip)
    path.write_text(damage(path.read_text()))
    with pytest.raises(BvhError, match=reason) as caught:
        read_bvh(path)
    assert "broken.bvh" in str(caught.value)
