"""Clips resample, mirror and cut without changing the motion."""

import numpy as np
import pytest
from roam_character.clip import Clip, clip_of


def test_resampling_keeps_the_motion(clip):
    fast = clip.resampled(96.0)
    assert fast.duration == pytest.approx(clip.duration)
    assert np.allclose(fast.positions()[::4], clip.positions(), atol=1e-5)
    assert np.allclose(np.linalg.norm(clip.resampled(30.0).rotations, axis=-1), 1, atol=1e-5)


def test_mirroring_twice_is_the_same_and_once_exchanges_the_sides(clip):
    mirrored = clip.mirrored()
    skeleton = clip.skeleton
    left, right = skeleton.index("leftFoot"), skeleton.index("rightFoot")
    assert np.allclose(mirrored.positions()[:, left], clip.positions()[:, right] * [-1, 1, 1], atol=1e-5)
    assert np.allclose(mirrored.mirrored().rotations, clip.rotations)


def test_poses_and_cut_address_the_same_frames(clip):
    assert np.allclose(clip.cut(5, 9).positions()[2], clip.pose(7).positions())
    assert len(clip.cut(5, 9)) == 5
    assert np.allclose(clip_of([clip.pose(i) for i in range(24)], 24.0).rotations, clip.rotations)


def test_wrong_shapes_are_refused(clip):
    with pytest.raises(ValueError, match=r"\[T, J, 4\]"):
        Clip(clip.skeleton, 24.0, clip.root_positions, clip.rotations[:, :5])
