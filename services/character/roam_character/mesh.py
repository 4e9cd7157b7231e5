"""Meshes: where joints rest, and normals for triangles with smooth surfaces and sharp edges."""

import numpy as np

from roam_character.skeleton import Skeleton


def rest_origins(skeleton: Skeleton) -> np.ndarray:
    """Joint positions [J, 3] of the rest pose with the root at its rest offset [m]."""
    origins = np.zeros((skeleton.joint_count, 3))
    for joint, parent in enumerate(skeleton.parents):
        origins[joint] = skeleton.rest_offsets[joint] + (origins[parent] if parent >= 0 else 0)
    return origins


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
