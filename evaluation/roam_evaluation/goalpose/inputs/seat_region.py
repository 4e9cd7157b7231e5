"""Where a person can plausibly sit on a canonical object: the ground truth that poses are judged by.

Found independently of the solver, from the mesh alone: the patch of upward-facing surface near the seat height of the
catalogue (or, without one, the largest such patch at sitting height) with free space above it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

Array = npt.NDArray[np.floating]

CELL = 0.02  # [m]
LEVEL = 0.07  # [m] how far from the seat's height the patch may lie: cushions, slopes
HEADROOM = (0.10, 0.55)  # [m] free above the patch
SITTING_HEIGHTS = (0.25, 0.80)  # [m] where a seat is looked for without a catalogue
SAMPLES = 150_000
FRONT = 0.12  # [m] of the seat's depth that thighs lie over last


@dataclass(frozen=True, eq=False)
class SeatRegion:
    """Cells of the seat's plan with the local height of the surface."""

    points: Array  # [N, 3] surface points at cell centres, world [m]
    has_back: bool  # something rises over the seat: then there is a front

    @property
    def height(self) -> float:
        """The usual height of the seat's surface, world [m]."""
        return float(np.median(self.points[:, 1]))

    @property
    def edge(self) -> float:
        """How high the seat's front edge is, world [m]: over it thighs must go to the floor."""
        front = self.points[:, 2] > self.points[:, 2].max() - FRONT
        return float(np.percentile(self.points[front, 1], 90))

    def distance(self, hip: Array, hip_height: float) -> float:
        """From the hips joint to the nearest place where it would be if the person sat there [m]."""
        return float(np.linalg.norm(self.points + np.array([0.0, hip_height, 0.0]) - hip, axis=-1).min())


def sample_mesh(vertices: Array, faces: npt.NDArray[np.integer], *, count: int = SAMPLES) -> tuple[Array, Array]:
    """Uniform points and unit normals of a mesh, [count, 3] each; always the same ones."""
    corners = vertices[faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=-1)
    random = np.random.default_rng(0)
    chosen = random.choice(len(faces), count, p=area / area.sum())
    u, v = np.sqrt(random.random((count, 1))), random.random((count, 1))
    a, b, c = corners[chosen].transpose(1, 0, 2)
    points = (1 - u) * a + u * (1 - v) * b + u * v * c
    return points, cross[chosen] / np.maximum(area[chosen, None], 1e-12)


def seat_region(vertices: Array, faces: npt.NDArray[np.integer], *, seat_height: float | None) -> SeatRegion | None:
    """The seat of a canonical object, None when there is no surface to sit on. `seat_height` above the floor [m]."""
    points, normals = sample_mesh(vertices, faces)
    floor = float(points[:, 1].min())
    height = points[:, 1] - floor
    if seat_height is None:
        seat_height = _likely_seat_height(height, normals)
    low = points.min(0)
    cells = np.floor((points[:, [0, 2]] - low[[0, 2]]) / CELL).astype(int)
    shape = cells.max(0) + 1
    near = (np.abs(height - seat_height) < LEVEL) & (np.abs(normals[:, 1]) > 0.75)
    top = np.full(shape, -np.inf)
    np.maximum.at(top, tuple(cells[near].T), height[near])
    over = height - np.where(np.isfinite(top), top, 1e9)[tuple(cells.T)]
    blocked = np.zeros(shape, bool)
    blocked[tuple(cells[(over > HEADROOM[0]) & (over < HEADROOM[1])].T)] = True
    free = ndimage.binary_closing(np.pad(np.isfinite(top), 3), iterations=3)[3:-3, 3:-3] & ~blocked
    labels, count = ndimage.label(free)
    if count == 0:
        return None
    sizes = ndimage.sum_labels(free, labels, np.arange(1, count + 1))
    patch = labels == 1 + int(np.argmax(sizes))
    if sizes.max() * CELL**2 < 0.02:
        return None
    x, z = np.nonzero(patch)
    local = np.where(np.isfinite(top), top, seat_height)[x, z]
    where = np.stack([low[0] + (x + 0.5) * CELL, floor + local, low[2] + (z + 0.5) * CELL], -1)
    return SeatRegion(where, has_back=bool((height > seat_height + 0.18).mean() > 0.03))


def _likely_seat_height(height: Array, normals: Array) -> float:
    """Height [m] with the most upward- or downward-facing surface among sitting heights."""
    low, high = SITTING_HEIGHTS
    flat = (np.abs(normals[:, 1]) > 0.85) & (height > low) & (height < high)
    if not flat.any():
        return 0.45
    counts, edges = np.histogram(height[flat], bins=np.arange(low, high + 0.02, 0.02))
    smooth = np.convolve(counts, [1, 2, 1], mode="same")
    peak = int(np.argmax(smooth))
    return float((edges[peak] + edges[peak + 1]) / 2)
