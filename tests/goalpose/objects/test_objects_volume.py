"""The coarse grid that motion keeps bodies out of, against the distance it was made from."""

from pathlib import Path

import numpy as np
import pytest
from roam_character.distance import turn_about_y
from roam_character.volume import STEP, Volume
from roam_goalpose.objects import load_shape
from roam_goalpose.objects.volume import shape_volume

EXAMPLES = Path(__file__).parents[3] / "examples" / "objects"


@pytest.mark.parametrize("name", ["chair", "sofa"])
def test_nodes_tell_the_distance_to_the_object(name):
    shape = load_shape((EXAMPLES / f"{name}.glb").read_bytes(), "glb")
    volume = shape_volume(shape)
    assert volume.values.size < 45_000
    rng = np.random.default_rng(0)
    nodes = np.stack([rng.integers(0, n, 200) for n in volume.values.shape], -1)
    points = volume.origin + volume.pitch * nodes @ turn_about_y(volume.yaw).T
    told = volume.values[tuple(nodes.T)] * STEP
    np.testing.assert_allclose(told, np.clip(shape.distance.sample(points), -127 * STEP, 127 * STEP), atol=0.002)
    assert (volume.values < 0).any()
    assert (volume.values > 0).mean() > 0.3


def test_a_volume_survives_packing():
    shape = load_shape((EXAMPLES / "stool.glb").read_bytes(), "glb")
    volume = shape_volume(shape).moved(np.array([0.1, -0.2, 0.3]))
    again = Volume.unpacked(volume.packed)
    np.testing.assert_array_equal(again.values, volume.values)
    np.testing.assert_array_equal(again.origin, volume.origin)
    assert (again.pitch, again.yaw) == (volume.pitch, volume.yaw)
    with pytest.raises(ValueError, match="not a packed volume"):
        Volume.unpacked(volume.packed[:50])
