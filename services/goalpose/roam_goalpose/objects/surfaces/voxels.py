"""Signed distance on a grid, for any soup of triangles and any point cloud.

Free meshes are open, thin, self-intersecting and inconsistently wound, so nothing here trusts closedness or winding:

1. The surface, densely sampled, gives the unsigned distance u at every node.
2. Nodes with u > r are *free*; r closes gaps narrower than 2 r. Free nodes that air from the sides or the top reaches
   are *outside*; the floor is closed, and hollows that are walled on four sides and above and reach down near the floor
   count as body, because furniture is often modelled without its underside.
3. A node is inside when it is farther than r from everything outside (a morphological closing, so plates thinner than
   r keep both their faces). Its depth is that distance less r.
4. Sheets without thickness are given some, or a grid could not hold them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from roam_character.distance import DistanceGrid
from scipy import ndimage

from roam_goalpose.objects.surfaces.windows import largest_near, smallest_near

Floats = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.integer]
Corner = npt.NDArray[np.float64]

_NODE_BUDGET = 400_000  # decides the pitch, and with it most of the time that loading takes
_FINEST, _COARSEST = 0.0125, 0.03  # [m]
_PAD = 0.15  # [m] of free nodes around the box
_OFF_CENTRE = 0.137  # [nodes] furniture is symmetric and round in its measures: no wall shall lie midway between nodes
_HOLE = 1.25  # [spacings] at random, one disc of this radius in 10^5 has no sample; larger holes are openings
_MIN_GAP = 0.03  # [m] narrower openings are closed
# [m] A hollow that opens only to a floor this near is the body of a sofa, not the legroom of a chair.
_DEEPEST_UNDERSIDE = 0.28
_MIN_HOLLOW = 0.10  # [m] lower hollows (between stretchers, inside an apron) stay open ...
_CREVICE = 0.002  # [m^3] ... except crevices this small, behind cushions


@dataclass(frozen=True)
class Surface:
    """A dense sampling of a surface.

    Attributes:
        points: `[M, 3]` [m], +Y up.
        normals: `[M, 3]` unit, of either sign.
        spacing: usual distance between neighbours [m]; holes of this size are not openings.
    """

    points: Floats
    normals: Floats
    spacing: float


def choose_pitch(extents: npt.NDArray[np.float64]) -> float:
    """Node spacing [m] at which a box of `extents` [m] with its margin has about `_NODE_BUDGET` nodes."""
    volume = float(np.prod(extents + 2 * _PAD))
    pitch = float(np.clip((volume / _NODE_BUDGET) ** (1 / 3), _FINEST, _COARSEST))
    return round(pitch, 4)  # the same for an upload that was turned and rounded


def signed_distance(surface: Surface, *, box: Corner, pitch: float, floor: float, yaw: float = 0.0) -> DistanceGrid:
    """Signed distance to the body that a surface bounds.

    Args:
        surface: its samples, in the grid's axes.
        box: `[2, 3]` corners of the object in the grid's axes [m].
        pitch: node spacing [m].
        floor: height of the floor on which the object stands [m].
        yaw: by which the grid's axes are turned about the world's +Y [rad].
    """
    shape = np.ceil((box[1] - box[0] + 2 * _PAD) / pitch - 1e-3).astype(int) + 1  # rounding adds no node
    low = box.mean(axis=0) - pitch * (0.5 * (shape - 1) + _OFF_CENTRE)
    nearest, unsigned, touching = _unsigned(surface, low, pitch, tuple(int(n) for n in shape))
    radius = max(0.5 * _MIN_GAP, 0.9 * pitch, _HOLE * surface.spacing)
    level = int(np.floor((floor - low[1]) / pitch))
    outside = _outside((unsigned > radius) & ~touching, level=level, pitch=pitch)
    depth = _depth(outside, unsigned, radius, pitch)
    values = np.where(depth > 0, -depth, unsigned)
    close = (depth > 0) & (np.abs(depth - unsigned) < 0.5 * pitch)
    values[close] = -unsigned[close]  # u knows the surface better than the closing does
    values -= _padding(depth, nearest, pitch)
    return DistanceGrid(low, pitch, values, yaw)


def _unsigned(surface: Surface, low: Corner, pitch: float, shape: tuple[int, ...]) -> tuple[Ints, Floats, Mask]:
    """For every node: the flat index of the nearest node that holds a sample; the distance to that sample's disc [m];
    whether the node or one beside it holds a sample.

    The nearest sample may lie in another cell: at sharp edges the distance is up to a pitch too large, and a wall made
    of small distances alone would have holes there.
    """
    local = (surface.points - low.astype(np.float32)) / np.float32(pitch)
    holder = _holders(local, shape)
    holds = (holder >= 0).reshape(shape)
    nearest = _nearest(holds)
    sample = holder.take(nearest, mode="clip")
    plane = np.zeros(shape, dtype=np.float32)
    square = np.zeros(shape, dtype=np.float32)
    for axis in range(3):
        steps = np.arange(shape[axis], dtype=np.float32).reshape([-1 if a == axis else 1 for a in range(3)])
        delta = steps - np.ascontiguousarray(local[:, axis]).take(sample, mode="clip")
        plane += delta * np.ascontiguousarray(surface.normals[:, axis]).take(sample, mode="clip")
        square += delta * delta
    lateral = np.sqrt(np.maximum(square - plane * plane, 0.0))
    reach = np.float32(max(0.35, 0.5 * surface.spacing / pitch))
    aside = np.maximum(lateral - reach, 0.0).astype(np.float64)
    away = np.sqrt(plane.astype(np.float64) ** 2 + aside**2)  # float32's own hypot does the same four times as slowly
    distance = away.astype(np.float32) * np.float32(pitch)
    touching = np.logical_or.reduce([largest_near(holds, axes=(axis,)) for axis in range(3)])
    return nearest, distance, touching


def _holders(local: Floats, shape: tuple[int, ...]) -> Ints:
    """For every node the number of a sample in its cell, one near the node, or -1; `local` `[M, 3]` in nodes."""
    cell = np.rint(local)
    away = local - cell
    x, y, z = cell.astype(np.intp).T
    flat = (x * shape[1] + y) * shape[2] + z
    offset = np.einsum("ij,ij->i", away, away)
    holder = np.full(int(np.prod(shape)), -1, dtype=np.intp)
    for within in (1.0, 0.25, 0.1, 0.04):  # the last write wins: a sample near the node, without a sort
        chosen = np.flatnonzero(offset < within)
        holder[flat[chosen]] = chosen
    return holder


def _nearest(there: Mask) -> Ints:
    """The flat index of the nearest node that is `there`, for every node."""
    x, y, z = ndimage.distance_transform_edt(~there, return_distances=False, return_indices=True)
    flat: Ints = (x * there.shape[1] + y) * there.shape[2] + z
    return flat


def _outside(free: Mask, *, level: int, pitch: float) -> Mask:
    """Free nodes that are not enclosed. `level` is the last layer of nodes below the floor."""
    air = free.copy()
    air[:, : level + 1] = False
    walled = walled_in(air, ~free, level=level, pitch=pitch)
    # What is behind walled nodes is cut off too: pockets between a hollow and its walls.
    air &= ~walled
    labels, count = ndimage.label(air)
    reached = np.zeros(count + 1, dtype=bool)
    for side in _open_sides():
        reached[labels[side]] = True
    return free & ~walled & ~(air & ~reached[labels])


def _open_sides() -> list[tuple[slice | int, ...]]:
    everything = slice(None)
    return [(0,), (-1,), (everything, everything, 0), (everything, everything, -1), (everything, -1)]


def walled_in(air: Mask, wall: Mask, *, level: int, pitch: float) -> Mask:
    """Air that is walled in on four sides and above, in hollows that reach down near the floor (or end on a wall).

    `level` is the last layer of nodes `[X, Y, Z]` below the floor, `pitch` their spacing [m]. The labels that the field
    is trained with take the same hollows for body.
    """
    seen = air.copy()
    for axis in (0, 2):
        seen &= np.logical_or.accumulate(wall, axis=axis)
        seen &= np.flip(np.logical_or.accumulate(np.flip(wall, axis), axis=axis), axis)
    seen &= np.flip(np.logical_or.accumulate(np.flip(wall, 1), axis=1), 1)
    below = np.ones(seen[:, 0].shape, dtype=bool)
    for layer in range(level + 1 + round(_DEEPEST_UNDERSIDE / pitch), seen.shape[1]):
        seen[:, layer] &= below
        below = seen[:, layer] | wall[:, layer]
    if not seen.any():
        return seen
    seen = smallest_near(largest_near(seen)) & air
    run = max(2, round(_MIN_HOLLOW / pitch))
    before, after = run // 2, (run - 1) // 2  # an even window is off centre by one, its mirror image undoes it
    eroded = smallest_near(smallest_near(seen, axes=(0, 2)), before=before, after=after, axes=(1,))
    opened = largest_near(largest_near(eroded, axes=(0, 2)), before=after, after=before, axes=(1,))
    labels, count = ndimage.label(seen)
    kept = np.bincount(labels.ravel(), minlength=count + 1) * pitch**3 < _CREVICE
    kept[labels[opened]] = True  # a high hollow is kept whole
    kept[0] = False
    walled: Mask = kept[labels]
    return walled


def _depth(outside: Mask, unsigned: Floats, radius: float, pitch: float) -> Floats:
    """How far inside the closed body a node lies [m]; 0 outside."""
    depth = np.zeros(outside.shape, dtype=np.float32)
    box = ndimage.find_objects((~outside).view(np.int8))[0]
    margin = tuple(slice(max(s.start - 1, 0), min(s.stop + 1, n)) for s, n in zip(box, outside.shape, strict=True))
    indices = ndimage.distance_transform_edt(~outside[margin], return_distances=False, return_indices=True)
    inside = np.nonzero(~outside[margin])
    goal = tuple(one[inside] for one in indices)
    steps = np.sqrt(sum((a - b).astype(np.float64) ** 2 for a, b in zip(goal, inside, strict=True)))
    # The outside node lies somewhat beyond the level set u = r.
    beyond = np.clip(unsigned[margin][goal] - radius, 0.0, 1.5 * pitch)
    depth[margin][inside] = np.maximum(steps * pitch - beyond - radius, 0.0)
    return depth


def _padding(depth: Floats, nearest: Ints, pitch: float) -> Floats:
    """What to take off the distance so that sheets are at least a centimetre thick and visible on the grid [m]."""
    # A sheet midway between nodes reads 0.5 pitch less this.
    half = max(0.005, 0.65 * pitch)
    missing = np.clip(half - largest_near(depth), 0.0, half)
    padding: Floats = missing.ravel()[nearest]
    return padding
