"""A mesh format of our own, added to the registry in this one file: a box a line, corner and size in metres."""

from collections.abc import Mapping

import numpy as np
from roam_goalpose.objects.errors import malformed
from roam_goalpose.objects.geometry import Geometry, Part, join
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.readers import Format, register

_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
_QUADS = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
_FACES = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])


def read_boxes(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """Every line a box; raises ObjectError."""
    parts = []
    for line in data.decode("ascii", errors="replace").splitlines()[1:]:
        try:
            numbers = np.array([float(word) for word in line.split()])
            parts.append(Part("box", numbers[:3] + _CORNERS * numbers[3:6], _FACES))
        except (ValueError, IndexError) as error:
            raise malformed("boxes", f"{line[:40]!r} is no box") from error
    geometry = join(parts)
    return Geometry(geometry.vertices, geometry.faces, "y", 1.0)


register(Format("boxes", "Boxes", ("boxes",), "toy_reader:read_boxes", begins=(b"BOXES",), unit="m", up="y"))
