"""Bodies drawn from joint positions alone, so that captured people and the product look the same."""

import numpy as np
from roam_character.body import body_capsules

from roam_evaluation.motion.people.frames import HEAD, SKELETON, THIGHS
from roam_evaluation.shared.picture import BODY_COLOUR, LEFT_COLOUR, Pixels, Splats, render

_CAPSULES = body_capsules(SKELETON)
_RADII = {int(j): float(r) for j, r in zip(_CAPSULES.joints, _CAPSULES.radii, strict=True)}
_TIPS = {tip.parent: float(np.linalg.norm(tip.offset)) for tip in SKELETON.tips}
_FLOOR_COLOUR = (0.86, 0.86, 0.84)
# Azimuth against the facing and elevation [rad]: from the body's left, from ahead, from ahead and above.
SIDE, FRONT, ABOVE = (np.pi / 2, 0.16), (0.0, 0.16), (0.4, 0.9)


def body_splats(positions: np.ndarray, *, density: float = 30_000.0) -> Splats:
    """Surface samples of capsules along the bones of one frame [22, 3]; the left limbs are green."""
    random = np.random.default_rng(0)
    parts = [_capsule(a, b, r, density, left, random) for a, b, r, left in _segments(positions)]
    return Splats(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("points", "normals", "colours"))
    )


def _segments(positions: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, float, bool]]:
    """Ends, radius and side of every bone."""
    out = []
    for joint, parent in enumerate(SKELETON.parents):
        name = SKELETON.joint_names[joint]
        if parent >= 0 and parent in _RADII and "Shoulder" not in name and "UpperLeg" not in name:
            out.append((positions[parent], positions[joint], _RADII[parent], name.startswith("left")))
        if joint in _TIPS and parent >= 0:
            along = positions[joint] - positions[parent]
            along = along / max(np.linalg.norm(along), 1e-9)
            length = 0.5 * _TIPS[joint] if joint == HEAD else _TIPS[joint]
            out.append((positions[joint], positions[joint] + along * length, _RADII[joint], name.startswith("left")))
    out.append((positions[THIGHS[0]], positions[THIGHS[1]], _RADII[0], False))
    return out


def _capsule(
    start: np.ndarray, end: np.ndarray, radius: float, density: float, left: bool, random: np.random.Generator
) -> Splats:
    axis = end - start
    length = float(np.linalg.norm(axis))
    count = max(int(density * 2 * np.pi * radius * (length + 2 * radius)), 30)
    direction = random.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    unit = axis / max(length, 1e-9)
    along = direction @ unit
    side = random.random(count) < length / (length + 2 * radius)
    t = np.where(side, random.random(count), np.where(along > 0, 1.0, 0.0))
    flat = direction - along[:, None] * unit
    flat /= np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), 1e-9)
    normals = np.where(side[:, None], flat, direction)
    points = start + t[:, None] * axis + radius * normals
    colours = np.broadcast_to(np.array(LEFT_COLOUR if left else BODY_COLOUR), points.shape)
    return Splats(points, normals, colours)


def floor_splats(centre: np.ndarray, *, reach: float = 1.5, square: float = 0.5, grain: float = 0.03) -> Splats:
    """Every other square of a chequered floor round a place (x, z): it stands still in the world, so sliding shows."""
    low, high = centre - reach, centre + reach
    x, z = np.meshgrid(np.arange(low[0], high[0], grain), np.arange(low[1], high[1], grain))
    dark = (np.floor(x / square) + np.floor(z / square)) % 2 == 0
    points = np.stack([x[dark], np.zeros(int(dark.sum())), z[dark]], -1)
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), points.shape)
    return Splats(points, up, np.broadcast_to(np.array(_FLOOR_COLOUR), points.shape))


def picture(
    positions: np.ndarray,
    view: tuple[float, float],
    centre: np.ndarray,
    *,
    size: int,
    span: float,
    scene: list[Splats] | None = None,
) -> Pixels:
    """One frame [22, 3] seen from an azimuth and an elevation [rad], `span` [m] wide, centred on `centre` [3]."""
    splats = [floor_splats(centre[[0, 2]]), *(scene or []), body_splats(positions)]
    return render(splats, azimuth=view[0], elevation=view[1], size=size, span=span, center=centre)
