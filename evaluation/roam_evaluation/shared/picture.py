"""Shaded pictures of an object with a capsule body in it: a software point splatter, quick enough for contact sheets.

Surfaces are sampled densely, lit by one lamp and splatted with a depth buffer (orthographic). Body points that lie in
the object deeper than the tolerance turn red, so that penetrations show in any view.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw
from roam_character.body import body_capsules
from roam_character.pose import Pose

Array = npt.NDArray[np.floating]
Pixels = npt.NDArray[np.uint8]

OBJECT_COLOUR = (0.50, 0.60, 0.74)
BODY_COLOUR = (0.93, 0.62, 0.30)
LEFT_COLOUR = (0.45, 0.72, 0.42)  # the left limbs differ, so that crossed legs show
DEEP_COLOUR = (0.85, 0.05, 0.10)
_LAMP = np.array([0.35, 0.8, 0.5]) / np.linalg.norm([0.35, 0.8, 0.5])


@dataclass(frozen=True, eq=False)
class Splats:
    """Coloured surface points."""

    points: Array  # [N, 3] world [m]
    normals: Array  # [N, 3]
    colours: Array  # [N, 3] in 0..1


def object_splats(vertices: Array, faces: npt.NDArray[np.integer], *, count: int = 120_000, seed: int = 0) -> Splats:
    """Uniform samples of a triangle mesh. `vertices` [V, 3], `faces` [F, 3]."""
    corners = vertices[faces.astype(np.int64)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=-1)
    random = np.random.default_rng(seed)
    chosen = random.choice(len(faces), count, p=area / area.sum())
    u, v = np.sqrt(random.random((count, 1))), random.random((count, 1))
    a, b, c = corners[chosen].transpose(1, 0, 2)
    points = (1 - u) * a + u * (1 - v) * b + u * v * c
    normals = cross[chosen] / np.maximum(area[chosen, None], 1e-12)
    return Splats(points, normals, np.broadcast_to(np.array(OBJECT_COLOUR), points.shape))


def cloud_splats(points: Array, normals: Array | None) -> Splats:
    """A bare point cloud. `points` [N, 3], `normals` [N, 3] or None."""
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), points.shape) if normals is None else normals
    return Splats(points, up, np.broadcast_to(np.array(OBJECT_COLOUR), points.shape))


def body_splats(pose: Pose, *, density: float = 150_000.0, seed: int = 0) -> Splats:
    """Samples of the capsule body's surface, `density` points a square metre."""
    random = np.random.default_rng(seed)
    capsules = body_capsules(pose.skeleton)
    starts, ends = capsules.segments(*pose.posture())
    points, normals, colours = [], [], []
    for start, end, radius, name in zip(starts, ends, capsules.radii, capsules.names, strict=True):
        axis = end - start
        length = float(np.linalg.norm(axis))
        count = int(density * 2 * np.pi * radius * (length + 2 * radius))
        direction = random.normal(size=(count, 3))
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        along = direction @ (axis / max(length, 1e-9))
        t = np.where(along > 0, 1.0, 0.0)
        side = random.random(count) < length / (length + 2 * radius)
        t = np.where(side, random.random(count), t)
        flat = direction - along[:, None] * axis / max(length, 1e-9)
        flat /= np.linalg.norm(flat, axis=-1, keepdims=True)
        normal = np.where(side[:, None], flat, direction)
        points.append(start + t[:, None] * axis + radius * normal)
        normals.append(normal)
        colours.append(np.broadcast_to(LEFT_COLOUR if name.startswith("left") else BODY_COLOUR, normal.shape))
    return Splats(np.concatenate(points), np.concatenate(normals), np.concatenate(colours))


def mark_deep(splats: Splats, distances: Array, *, tolerance: float = 0.03) -> Splats:
    """Colours the points whose signed `distances` [N] [m] are below minus the tolerance."""
    deep = (np.asarray(distances) < -tolerance)[:, None]
    return Splats(splats.points, splats.normals, np.where(deep, np.array(DEEP_COLOUR), splats.colours))


def render(
    splats: list[Splats], *, azimuth: float, elevation: float = 0.2, size: int = 300, span: float = 1.9, center: Array
) -> Pixels:
    """Orthographic picture [size, size, 3].

    `azimuth` 0 looks at the front (from +Z), pi/2 from +X (the left side) [rad]; `span` [m] is the picture's width.
    """
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    right = np.array([ca, 0.0, -sa])
    toward = np.array([sa * ce, se, ca * ce])  # from the scene to the eye
    up = np.cross(toward, right)
    points = np.concatenate([s.points for s in splats]) - center
    normals = np.concatenate([s.normals for s in splats])
    colours = np.concatenate([s.colours for s in splats])
    facing = normals * np.sign(normals @ toward)[:, None]
    light = 0.45 + 0.55 * np.clip(facing @ (_LAMP @ np.stack([right, up, toward])), 0, 1)
    scale = size / span
    u = np.round(size / 2 + scale * (points @ right)).astype(int)
    v = np.round(size / 2 - scale * (points @ up)).astype(int)
    order = np.argsort(points @ toward, kind="stable")
    image = np.full((size, size, 3), 250, np.uint8)
    shaded = (255 * np.clip(colours * light[:, None], 0, 1)).astype(np.uint8)
    for du, dv in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x, y = u[order] + du, v[order] + dv
        inside = (x >= 0) & (x < size) & (y >= 0) & (y < size)
        if (du, dv) == (0, 0):
            depth = np.full((size, size), -np.inf)
        d = (points @ toward)[order][inside]
        keep = d >= depth[y[inside], x[inside]]
        image[y[inside][keep], x[inside][keep]] = shaded[order][inside][keep]
        np.maximum.at(depth, (y[inside], x[inside]), d)
    return image


VIEWS = {"three-quarter": (0.7, 0.35), "side": (np.pi / 2, 0.05), "front": (0.0, 0.12)}


def scene_views(
    splats: list[Splats], *, size: int = 260, views: dict[str, tuple[float, float]] | None = None
) -> Pixels:
    """The views side by side, framed on the whole scene. -> [size, size * views, 3]."""
    points = np.concatenate([s.points for s in splats])
    low, high = points.min(0), points.max(0)
    span = float(np.linalg.norm(high - low)) * 1.02
    center = (low + high) / 2
    chosen = VIEWS if views is None else views
    return np.concatenate(
        [render(splats, azimuth=a, elevation=e, size=size, span=span, center=center) for a, e in chosen.values()],
        axis=1,
    )


def contact_sheet(cells: list[tuple[str, Pixels]], *, columns: int = 3) -> Image.Image:
    """Captioned pictures of equal size in a grid."""
    height, width = cells[0][1].shape[:2]
    rows = -(-len(cells) // columns)
    sheet = Image.new("RGB", (columns * (width + 6), rows * (height + 20)), "white")
    draw = ImageDraw.Draw(sheet)
    for i, (caption, pixels) in enumerate(cells):
        x, y = (i % columns) * (width + 6), (i // columns) * (height + 20)
        sheet.paste(Image.fromarray(pixels), (x, y + 16))
        draw.text((x + 4, y + 2), caption, fill="black")
    return sheet
