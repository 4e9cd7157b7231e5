"""From a solid to triangles: marching cubes near the surface only, then quadric decimation.

Needs scikit-image and fast-simplification (the extra `figure`); the services never import this module.
"""

import numpy as np

from roam_character.figure.garments import Piece

_COARSE = 4  # cells of the coarse grid; where it is farther from the surface than its diagonal nothing is looked at


def triangles(piece: Piece) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices [V, 3] [m], their normals [V, 3] and outward faces [F, 3] of a piece."""
    from fast_simplification import simplify
    from skimage.measure import marching_cubes

    values, low = _sampled(piece)
    found = marching_cubes(values, 0.0, spacing=(piece.spacing,) * 3)  # type: ignore[no-untyped-call]
    vertices, faces = found[:2]
    vertices = vertices + low
    if len(faces) > piece.triangles:
        vertices, faces = simplify(
            vertices.astype(np.float32), faces.astype(np.int32), target_count=piece.triangles, agg=2
        )
    vertices = np.asarray(vertices, float)
    return vertices, normals(piece, vertices), _outward(vertices, np.asarray(faces, np.int64))


def normals(piece: Piece, vertices: np.ndarray) -> np.ndarray:
    """The gradient of the distance, by central differences over a third of the spacing: smoother than the faces are."""
    step = piece.spacing / 3
    slopes = [piece.solid(vertices + step * axis) - piece.solid(vertices - step * axis) for axis in np.eye(3)]
    found = np.stack(slopes, axis=-1)
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=-1, keepdims=True), 1e-12))


def _outward(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = vertices[faces]
    volume = np.einsum("fa,fa->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return faces if volume > 0 else faces[:, ::-1]


def _sampled(piece: Piece) -> tuple[np.ndarray, np.ndarray]:
    """The distance on a grid [X, Y, Z], exact within a cell of the surface, and the grid's lowest corner [3]."""
    low, high, step = np.asarray(piece.low, float), np.asarray(piece.high, float), piece.spacing
    blocks = np.ceil((high - low) / (_COARSE * step)).astype(int)
    centres = [low[a] + (np.arange(blocks[a]) + 0.5) * _COARSE * step for a in range(3)]
    coarse = piece.solid(np.stack(np.meshgrid(*centres, indexing="ij"), axis=-1).reshape(-1, 3)).reshape(blocks)
    near = np.abs(coarse) < 1.4 * _COARSE * step
    values = np.repeat(np.repeat(np.repeat(np.sign(coarse) * step, _COARSE, 0), _COARSE, 1), _COARSE, 2)
    wanted = np.repeat(np.repeat(np.repeat(near, _COARSE, 0), _COARSE, 1), _COARSE, 2)
    places = np.argwhere(wanted)
    values[tuple(places.T)] = piece.solid(low + (places + 0.5) * step)
    # Nothing reaches the walls of the box: a border of air closes what touches them.
    return np.pad(values, 1, constant_values=step), low - 0.5 * step
