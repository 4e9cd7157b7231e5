import numpy as np
import pytest
from roam_goalpose.objects.surfaces.windows import largest_near, smallest_near
from scipy import ndimage


@pytest.mark.parametrize(("before", "after"), [(1, 1), (2, 2), (3, 2), (0, 1)])
def test_windows_find_what_ndimage_finds(before, after):
    values = np.random.default_rng(0).random((7, 9, 11)).astype(np.float32)
    size, origin = before + after + 1, before - (before + after + 1) // 2
    most = ndimage.maximum_filter1d(values, size, axis=1, origin=origin)
    least = ndimage.minimum_filter1d(values, size, axis=1, origin=origin)
    np.testing.assert_array_equal(largest_near(values, before=before, after=after, axes=(1,)), most)
    np.testing.assert_array_equal(smallest_near(values, before=before, after=after, axes=(1,)), least)


def test_a_mask_grows_and_shrinks_by_a_node_on_every_side():
    mask = np.zeros((5, 5, 5), dtype=bool)
    mask[2, 2, 2] = True
    grown = largest_near(mask)
    assert grown.sum() == 27
    np.testing.assert_array_equal(smallest_near(grown), mask)
