"""Frames between `isolation` and `worker`: a JSON head and raw arrays, never pickles.

A frame is `<I` length of the head, the head (UTF-8 JSON; its `sizes` lists the parts), then the parts back to back.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from roam_character.distance import DistanceGrid

from roam_goalpose.objects.shape import Shape, ShapePiece, ShapeWarning

READY: Mapping[str, Any] = {"ready": True}
_MAX_HEAD = 1 << 20


def write_frame(stream: BinaryIO, head: Mapping[str, Any], parts: Sequence[bytes | memoryview]) -> None:
    """Write one frame and flush."""
    sizes = [part.nbytes if isinstance(part, memoryview) else len(part) for part in parts]
    text = json.dumps({**head, "sizes": sizes}).encode()
    stream.write(struct.pack("<I", len(text)) + text)
    for part in parts:
        stream.write(part)
    stream.flush()


def read_frame(stream: BinaryIO) -> tuple[dict[str, Any], list[bytes]] | None:
    """Read one frame; None when the other side has closed, at whatever point."""
    length = stream.read(4)
    if len(length) < 4:
        return None
    size = struct.unpack("<I", length)[0]
    if size > _MAX_HEAD:
        return None
    text = stream.read(size)
    if len(text) < size:
        return None
    head = json.loads(text)
    parts = [stream.read(count) for count in head["sizes"]]
    if any(len(part) < count for part, count in zip(parts, head["sizes"], strict=True)):
        return None
    return head, parts


def pack_shape(shape: Shape) -> tuple[dict[str, Any], list[memoryview]]:
    """A shape as head and parts; `unpack_shape` restores it bit for bit."""
    arrays: dict[str, npt.NDArray[Any]] = {
        "points": shape.points,
        "object_to_world": shape.object_to_world,
        "bounds": shape.bounds,
        "origin": shape.distance.origin,
        "values": shape.distance.values,
        "front": shape.front,
        **({} if shape.normals is None else {"normals": shape.normals}),
        **({} if shape.mesh is None else {"vertices": shape.mesh[0], "faces": shape.mesh[1]}),
    }
    head = {
        "name": shape.name,
        "floor_height": shape.floor_height,
        "pitch": shape.distance.pitch,
        "yaw": shape.distance.yaw,
        "warnings": [asdict(warning) for warning in shape.warnings],
        "pieces": [asdict(piece) for piece in shape.pieces],
        "arrays": [[name, array.dtype.str, list(array.shape)] for name, array in arrays.items()],
    }
    return head, [np.ascontiguousarray(array).data.cast("B") for array in arrays.values()]


def unpack_shape(head: Mapping[str, Any], parts: Sequence[bytes]) -> Shape:
    """The inverse of `pack_shape`."""
    arrays = {
        name: np.frombuffer(part, dtype=dtype).reshape(shape).copy()
        for (name, dtype, shape), part in zip(head["arrays"], parts, strict=True)
    }
    return Shape(
        name=head["name"],
        points=arrays["points"],
        normals=arrays.get("normals"),
        object_to_world=arrays["object_to_world"],
        floor_height=head["floor_height"],
        bounds=arrays["bounds"],
        distance=DistanceGrid(arrays["origin"], head["pitch"], arrays["values"], head["yaw"]),
        front=arrays["front"],
        mesh=(arrays["vertices"], arrays["faces"]) if "faces" in arrays else None,
        warnings=tuple(ShapeWarning(**warning) for warning in head["warnings"]),
        pieces=tuple(ShapePiece(one["name"], one["chosen"], tuple(one["bounds"])) for one in head["pieces"]),
    )
