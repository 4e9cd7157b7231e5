"""Triangle meshes of the stand-in body: capsules as vertices, normals and faces."""

from typing import NamedTuple

import numpy as np

from roam_character.body import body_capsules
from roam_character.rotation import quat_between, quat_rotate
from roam_character.skeleton import Skeleton


class BodyMesh(NamedTuple):
    """Every vertex moves with one joint (rigid skinning). Positions and normals are those of the rest pose."""

    vertices: np.ndarray  # [V, 3] [m]
    normals: np.ndarray  # [V, 3]
    faces: np.ndarray  # [F, 3]
    joints: np.ndarray  # [V] joint that carries the vertex


def capsule_mesh(
    start: np.ndarray, end: np.ndarray, radius: float, *, sides: int = 16, rings: int = 5
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices [V, 3], normals [V, 3], faces [F, 3] of a capsule between two points [m]."""
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length if length > 1e-6 else np.array([0.0, 1.0, 0.0])
    # Latitudes of both caps, the equator twice: once at each end of the cylinder.
    latitude = np.concatenate([np.linspace(-np.pi / 2, 0, rings + 1), np.linspace(0, np.pi / 2, rings + 1)])
    shift = np.concatenate([np.zeros(rings + 1), np.full(rings + 1, length)])
    longitude = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.cos(longitude), np.zeros(sides), np.sin(longitude)], axis=-1)
    normals = ring[None] * np.cos(latitude)[:, None, None] + np.array([0, 1.0, 0]) * np.sin(latitude)[:, None, None]
    points = normals * radius + np.array([0, 1.0, 0]) * shift[:, None, None]
    turn = quat_between(np.array([0.0, 1.0, 0.0]), axis)
    vertices = quat_rotate(turn, points.reshape(-1, 3)) + start
    return vertices, quat_rotate(turn, normals.reshape(-1, 3)), _grid_faces(len(latitude), sides)


def _grid_faces(rows: int, sides: int) -> np.ndarray:
    row, side = np.meshgrid(np.arange(rows - 1), np.arange(sides), indexing="ij")
    here, beside = row * sides + side, row * sides + (side + 1) % sides
    lower = np.stack([here, here + sides, beside], axis=-1)
    upper = np.stack([beside, here + sides, beside + sides], axis=-1)
    return np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])


def body_mesh(skeleton: Skeleton) -> BodyMesh:
    """The capsule body in the skeleton's rest pose, which must have identity rest rotations."""
    capsules = body_capsules(skeleton)
    origins = rest_origins(skeleton)
    parts, count = [], 0
    for joint, start, end, radius in zip(capsules.joints, capsules.starts, capsules.ends, capsules.radii, strict=True):
        vertices, normals, faces = capsule_mesh(start, end, float(radius))
        parts.append((vertices + origins[joint], normals, faces + count, np.full(len(vertices), joint)))
        count += len(vertices)
    vertices, normals, faces, joints = (np.concatenate(part) for part in zip(*parts, strict=True))
    vertices, normals = _flat_soles(skeleton, vertices, normals, joints)
    return BodyMesh(vertices.astype(np.float32), normals.astype(np.float32), faces, joints)


def _flat_soles(
    skeleton: Skeleton, vertices: np.ndarray, normals: np.ndarray, joints: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Feet and toes end on the floor of the rest pose: round capsules would reach up to 1.5 cm below it."""
    soles = [j for j, bone in enumerate(skeleton.humanoid_bones) if bone.endswith(("Foot", "Toes"))]
    below = np.isin(joints, soles) & (vertices[:, 1] < 0)
    vertices, normals = vertices.copy(), normals.copy()
    vertices[below, 1] = 0.0
    normals[below] = [0.0, -1.0, 0.0]
    return vertices, normals


def rest_origins(skeleton: Skeleton) -> np.ndarray:
    """Joint positions [J, 3] of the rest pose with the root at its rest offset [m]."""
    origins = np.zeros((skeleton.joint_count, 3))
    for joint, parent in enumerate(skeleton.parents):
        origins[joint] = skeleton.rest_offsets[joint] + (origins[parent] if parent >= 0 else 0)
    return origins


def posed_mesh(mesh: BodyMesh, skeleton: Skeleton, positions: np.ndarray, orientations: np.ndarray) -> np.ndarray:
    """Vertices [V, 3] of the body in a pose given by joint placements [J, 3], [J, 4] [m]."""
    local = mesh.vertices - rest_origins(skeleton)[mesh.joints]
    return np.asarray(positions[mesh.joints] + quat_rotate(orientations[mesh.joints], local))


def corner_normals(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points [P, 3], normals [P, 3] and faces [F, 3] of a mesh with smooth surfaces and sharp edges.

    A corner has the mean normal of its vertex where that is within 50° of its face's, else its face's own: upholstery
    looks round and boards have edges.
    """
    edges = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
    across = np.cross(edges[:, 0], edges[:, 1])
    means = np.zeros_like(vertices, dtype=float)
    for corner in range(3):
        np.add.at(means, faces[:, corner], across)
    flat, means = _directions(across), _directions(means)
    own = np.repeat(flat, 3, axis=0)
    smooth = means[faces.reshape(-1)]
    normals = np.where((own * smooth).sum(axis=-1, keepdims=True) > np.cos(np.radians(50)), smooth, own)
    rows = np.concatenate([vertices[faces.reshape(-1)], normals.round(5)], axis=1)
    found, back = np.unique(rows, axis=0, return_inverse=True)
    return found[:, :3], _directions(found[:, 3:]), back.reshape(-1, 3)


def _directions(vectors: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(lengths > 1e-20, vectors / np.maximum(lengths, 1e-20), np.array([0.0, 1.0, 0.0]))
