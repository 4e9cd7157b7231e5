"""How much an upload may cost before it is refused."""

from __future__ import annotations

from dataclasses import dataclass

from roam_goalpose.objects.errors import ObjectError


@dataclass(frozen=True)
class Limits:
    """Bounds on one upload.

    A scanned sofa straight from a phone has about half a million triangles and 30 MB; the defaults leave room for four
    times that and still keep one reader below 2 GiB.
    """

    bytes: int = 128 * 2**20
    vertices: int = 3_000_000
    faces: int = 2_000_000
    points: int = 30_000_000  # of a bare cloud, which is thinned on reading
    cpu_seconds: float = 10.0
    wall_seconds: float = 20.0
    memory_bytes: int = 2 * 2**30


def check_bytes(size: int, limits: Limits) -> None:
    """Raise OBJECT_EMPTY or OBJECT_TOO_LARGE for a file of `size` bytes."""
    if size == 0:
        raise ObjectError(
            "OBJECT_EMPTY",
            field="content",
            message="The file is empty (0 bytes).",
            remedy="Send the file's bytes as the request body.",
        )
    if size > limits.bytes:
        raise ObjectError(
            "OBJECT_TOO_LARGE",
            field="content",
            message=f"The file has {size} bytes; at most {limits.bytes} are read.",
            remedy="Leave out textures, or simplify the mesh: 20,000 triangles are plenty.",
        )


def check_counts(vertices: int, faces: int, limits: Limits) -> None:
    """Raise OBJECT_TOO_COMPLEX when a mesh (or what its header promises) is beyond the limits."""
    if vertices > limits.vertices or faces > limits.faces:
        raise ObjectError(
            "OBJECT_TOO_COMPLEX",
            field="content",
            message=(
                f"The object has {vertices} vertices and {faces} faces; at most {limits.vertices} and "
                f"{limits.faces} are read."
            ),
            remedy="Simplify it (in Blender: the Decimate modifier); 20,000 triangles are plenty.",
        )


def check_points(count: int, limits: Limits) -> None:
    """Raise OBJECT_TOO_COMPLEX when a point cloud (or what its header promises) is beyond the limits."""
    most = min(limits.points, limits.memory_bytes // 48)  # what a point costs while it is read
    if count > most:
        raise ObjectError(
            "OBJECT_TOO_COMPLEX",
            field="content",
            message=f"The cloud has {count} points; at most {most} are read.",
            remedy="Thin it before you send it (in CloudCompare: Edit > Subsample); 100,000 points are plenty.",
        )
