"""LAS and LAZ through laspy, E57 through pye57: scans in metres, Z up."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Geometry
from roam_goalpose.objects.limits import Limits, check_points
from roam_goalpose.objects.readers.scratch import scratch_file

_NOISE = (7, 18)  # LAS 1.4, table 17: low points and high noise


def read_las(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """All points but those that are classified as noise; raises ObjectError."""
    import laspy

    try:
        with laspy.open(io.BytesIO(data)) as reader:
            check_points(int(reader.header.point_count), limits)
            if reader.header.point_count > len(data):
                raise malformed("las", f"it is cut off: {reader.header.point_count} points are promised")
            cloud = reader.read()
        points = np.stack([np.asarray(cloud[axis], np.float64) for axis in "xyz"], axis=1)
        noise = np.isin(np.asarray(cloud.classification), _NOISE)
    except (ObjectError, MemoryError):
        raise
    except BaseException as error:  # the LAZ decoder raises a panic that is no Exception
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        raise malformed("las", "its header or its points are damaged") from error
    geometry = Geometry(points[~noise], None, "z", 1.0)
    if noise.any():
        return geometry.noted(
            "OBJECT_POINTS_DROPPED", f"{int(noise.sum())} points that the file marks as noise were left out."
        )
    return geometry


def read_e57(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """All scans in the file's own frame, points marked invalid left out; raises ObjectError."""
    import pye57

    try:
        with scratch_file(data, ".e57") as path:
            file = pye57.E57(str(path))
            check_points(sum(file.get_header(k).point_count for k in range(file.scan_count)), limits)
            scans = [file.read_scan(k, ignore_missing_fields=True, transform=True) for k in range(file.scan_count)]
            file.close()
        points = [np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1) for scan in scans]
    except (ObjectError, MemoryError):
        raise
    except Exception as error:  # the binding has several kinds
        raise malformed("e57", "its header or its scans are damaged") from error
    return Geometry(np.concatenate(points) if points else np.zeros((0, 3)), None, "z", 1.0)
