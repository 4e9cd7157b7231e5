"""Uploaded furniture as the goal pose service knows it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt
from roam.v1 import goal_pose_pb2, skeleton_pb2

from roam_client.connection.packing import Floats
from roam_client.errors import FormatError

FORMATS = (
    "obj", "glb", "gltf", "ply", "stl", "off", "xyz", "pcd", "npy", "usd", "usda", "usdc", "usdz", "fbx", "dae", "3mf",
    "las", "laz", "e57", "pts", "csv", "asc", "txt", "vrm", "zip",
)  # fmt: skip
TEXTS = ("csv", "asc", "txt")  # may hold anything: read when they are named, not found in folders
_CHUNK = 1 << 20  # bytes; the protocol's most per message


@dataclass(frozen=True)
class Warning:
    """Something that did not stop the request but that the caller should know."""

    reason: str
    message: str
    remedy: str = ""


def warnings_from_messages(messages: list[goal_pose_pb2.Warning]) -> tuple[Warning, ...]:
    """Decodes warnings."""
    return tuple(Warning(w.reason, w.message, w.remedy) for w in messages)


def outlines_from_messages(messages: Iterable[skeleton_pb2.Outline]) -> tuple[Floats, ...]:
    """Decodes outlines on the floor: [K, 2] corners x, z each [m]."""
    return tuple(np.array(message.corners, np.float32).reshape(-1, 2) for message in messages)


@dataclass(frozen=True, eq=False)
class Piece:
    """One of several things in a file."""

    name: str  # of its node or group, may be empty
    chosen: bool  # whether the object is this one
    bounds: npt.NDArray[np.float64]  # [2, 3] smallest, largest world coordinates [m]


@dataclass(frozen=True, eq=False)
class Object:
    """Geometry on the server, brought to metres with +Y up."""

    name: str  # "objects/sha256:<hex>"
    format: str
    unit: str
    up_axis: str
    object_to_world: npt.NDArray[np.float64]  # [4, 4] file coordinates -> world
    floor_height: float  # lowest point [m]
    bounds: npt.NDArray[np.float64]  # [2, 3] smallest, largest world coordinates [m]
    point_count: int
    warnings: tuple[Warning, ...] = ()
    footprint: tuple[Floats, ...] = ()  # [K, 2] corners x, z [m] of outlines that it covers of the floor
    pieces: tuple[Piece, ...] = ()  # of a file of several, in its order

    @classmethod
    def from_message(cls, message: goal_pose_pb2.Object) -> Self:
        """Decodes."""
        return cls(
            name=message.name,
            format=message.format,
            unit=message.unit,
            up_axis=message.up_axis,
            object_to_world=np.array(message.object_to_world, np.float64).reshape(4, 4),
            floor_height=message.floor_height,
            bounds=np.array([message.bounds_min, message.bounds_max], np.float64),
            point_count=message.point_count,
            warnings=warnings_from_messages(list(message.warnings)),
            footprint=outlines_from_messages(message.footprint),
            pieces=tuple(
                Piece(piece.name, piece.chosen, np.array([piece.bounds_min, piece.bounds_max], np.float64))
                for piece in message.pieces
            ),
        )


def format_of(path: Path) -> str:
    """The upload format that a file name says; FormatError when it is none of FORMATS."""
    ending = path.suffix.lower().removeprefix(".")
    if ending not in FORMATS:
        raise FormatError(
            f"{path.name}: cannot read {path.suffix or 'a file without an ending'}; give one of {', '.join(FORMATS)}"
        )
    return ending


def upload_requests(
    data: bytes,
    *,
    format: str,
    unit: str | None,
    up_axis: str | None,
    size: float | None = None,
    piece: str | None = None,
) -> Iterator[goal_pose_pb2.UploadObjectRequest]:
    """The messages of one upload: what it is, then its bytes in chunks."""
    yield goal_pose_pb2.UploadObjectRequest(
        format=format, chunk=data[:_CHUNK], unit=unit or "", up_axis=up_axis or "", size=size, piece=piece or ""
    )
    for start in range(_CHUNK, len(data), _CHUNK):
        yield goal_pose_pb2.UploadObjectRequest(chunk=data[start : start + _CHUNK])
