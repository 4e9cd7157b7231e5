"""Small furniture made of boxes, in metres, +Y up, facing +Z, standing on y = 0: known to the millimetre."""

import numpy as np
import trimesh


def box(low, high):
    """An axis-aligned box between two corners."""
    place = trimesh.transformations.translation_matrix(np.add(low, high) / 2)
    return trimesh.creation.box(np.subtract(high, low), transform=place)


def chair_parts():
    """Seat, back and four legs."""
    legs = [box((x, 0.0, z), (x + 0.04, 0.42, z + 0.04)) for x in (-0.22, 0.18) for z in (-0.22, 0.18)]
    return [box((-0.24, 0.42, -0.24), (0.24, 0.47, 0.24)), box((-0.24, 0.47, -0.24), (0.24, 0.92, -0.20)), *legs]


def box_chair():
    """A dining chair, 0.48 × 0.92 × 0.48 m, seat at 0.47 m."""
    return trimesh.util.concatenate(chair_parts())


def box_sofa():
    """A two-seater, 1.8 × 0.8 × 0.85 m, seat at 0.42 m."""
    parts = [
        box((-0.9, 0.0, -0.425), (0.9, 0.42, 0.425)),
        box((-0.9, 0.42, -0.425), (0.9, 0.8, -0.2)),
        box((-0.9, 0.42, -0.2), (-0.7, 0.6, 0.425)),
        box((0.7, 0.42, -0.2), (0.9, 0.6, 0.425)),
    ]
    return trimesh.util.concatenate(parts)
