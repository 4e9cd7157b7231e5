"""The figure as it is shipped, fitted to a skeleton: what exports and the page draw where no character is given."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from roam_character.mesh import rest_origins
from roam_character.rotation import quat_between, quat_rotate
from roam_character.skeleton import Skeleton, humanoid_skeleton

FILE = Path(__file__).parent / "person.npz"
STEP = 0.0001  # [m] of the stored positions


@dataclass(frozen=True)
class Surface:
    """One colour of the figure: sRGB in 0..1, roughness, and its triangles [F, 3]."""

    name: str
    colour: tuple[float, float, float]
    roughness: float
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class FigureMesh:
    """A skinned mesh in the rest pose of a skeleton whose rest rotations are identities."""

    vertices: np.ndarray  # [V, 3] [m]
    normals: np.ndarray  # [V, 3]
    joints: np.ndarray  # [V, 4] joint indices
    weights: np.ndarray  # [V, 4], summing to 1
    surfaces: tuple[Surface, ...]

    def posed(self, skeleton: Skeleton, positions: np.ndarray, orientations: np.ndarray) -> np.ndarray:
        """Vertices [V, 3] with the joints at [J, 3], turned by [J, 4] (linear skinning) [m]."""
        local = self.vertices[:, None] - rest_origins(skeleton)[self.joints]
        moved = positions[self.joints] + quat_rotate(orientations[self.joints], local)
        return np.asarray((self.weights[..., None] * moved).sum(axis=1))


@cache
def _shipped() -> FigureMesh:
    """On our humanoid skeleton."""
    with np.load(FILE) as file:
        faces = np.split(file["faces"].astype(np.int64), np.cumsum(file["counts"])[:-1])
        table = zip(file["names"], file["colours"], file["roughness"], faces, strict=True)
        surfaces = tuple(Surface(str(n), (float(c[0]), float(c[1]), float(c[2])), float(r), f) for n, c, r, f in table)
        normals = file["normals"].astype(float)
        weights = file["weights"].astype(float)
        return FigureMesh(
            vertices=file["vertices"] * STEP,
            normals=normals / np.linalg.norm(normals, axis=-1, keepdims=True),
            joints=file["joints"].astype(np.int64),
            weights=weights / weights.sum(axis=-1, keepdims=True),
            surfaces=surfaces,
        )


def figure_mesh(skeleton: Skeleton) -> FigureMesh:
    """The figure with the proportions of a humanoid skeleton: every bone is stretched and turned to its own.

    Bones that the skeleton lacks move with the nearest one before them. The rest rotations must be identities.
    """
    shipped, ours = _shipped(), humanoid_skeleton()
    if skeleton.id == ours.id:
        return shipped
    owner = _counterparts(ours, skeleton)
    origins = rest_origins(ours)
    girth = _height(skeleton, rest_origins(skeleton)) / _height(ours, origins)
    places = _places(ours, skeleton, owner, girth)
    turns, stretches, axes = _bone_changes(ours, places, girth)
    joints = shipped.joints
    local = shipped.vertices[:, None] - origins[joints]
    along = (local * axes[joints]).sum(axis=-1, keepdims=True) * axes[joints]
    scaled = girth * (local - along) + stretches[joints][..., None] * along
    weights = shipped.weights[..., None]
    turned = quat_rotate(turns[joints], np.repeat(shipped.normals[:, None], 4, axis=1))
    normals = (weights * turned).sum(axis=1)
    return FigureMesh(
        vertices=(weights * (places[joints] + quat_rotate(turns[joints], scaled))).sum(axis=1),
        normals=normals / np.linalg.norm(normals, axis=-1, keepdims=True),
        joints=owner[joints],
        weights=shipped.weights,
        surfaces=shipped.surfaces,
    )


def _counterparts(ours: Skeleton, skeleton: Skeleton) -> np.ndarray:
    """For each of our joints [22] the joint of the skeleton that moves it."""
    found = np.zeros(ours.joint_count, int)
    for joint, bone in enumerate(ours.humanoid_bones):
        parent = ours.parents[joint]
        before = int(found[parent]) if parent >= 0 else 0
        found[joint] = skeleton.humanoid_bones.index(bone) if bone in skeleton.humanoid_bones else before
    return found


def _places(ours: Skeleton, skeleton: Skeleton, owner: np.ndarray, girth: float) -> np.ndarray:
    """Where our joints [22, 3] come to lie: on the skeleton's; those that it lacks in proportion between their
    neighbours [m]."""
    from_, to = rest_origins(ours), rest_origins(skeleton)[owner]
    has = [bone in skeleton.humanoid_bones for bone in ours.humanoid_bones]
    for joint, parent in enumerate(ours.parents):
        if has[joint] or parent < 0:
            continue
        after = _child(ours, joint)
        while after is not None and not has[after]:
            after = _child(ours, after)
        if after is None:
            to[joint] = to[parent] + girth * (from_[joint] - from_[parent])
        else:
            share = np.linalg.norm(from_[joint] - from_[parent]) / np.linalg.norm(from_[after] - from_[parent])
            to[joint] = to[parent] + share * (to[after] - to[parent])
    return to


def _bone_changes(ours: Skeleton, places: np.ndarray, girth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Turn [22, 4], stretch along [22] and axis [22, 3] of each of our bones."""
    turns, stretches = np.tile(np.array([0.0, 0, 0, 1]), (ours.joint_count, 1)), np.full(ours.joint_count, girth)
    axes = np.tile(np.array([0.0, 1, 0]), (ours.joint_count, 1))
    from_ = rest_origins(ours)
    for joint, bone in enumerate(ours.humanoid_bones):
        child = _child(ours, joint)
        if child is None or bone in ("hips", "leftFoot", "rightFoot"):  # these keep their shape: size only
            continue
        end, other = from_[child] - from_[joint], places[child] - places[joint]
        length, wanted = float(np.linalg.norm(end)), float(np.linalg.norm(other))
        if wanted < 0.01:
            continue
        axes[joint], stretches[joint] = end / length, wanted / length
        if bone.endswith(("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")):
            turns[joint] = quat_between(axes[joint], other / wanted)
    return turns, stretches, axes


def _child(ours: Skeleton, joint: int) -> int | None:
    """The next joint of our chain; None at its end."""
    after = {"hips": "spine", "upperChest": "neck"}.get(ours.humanoid_bones[joint])
    children = [c for c, parent in enumerate(ours.parents) if parent == joint]
    return ours.humanoid_bones.index(after) if after else (children[0] if children else None)


def _height(skeleton: Skeleton, origins: np.ndarray) -> float:
    """From the ankles to the head's joint [m]."""
    bones = skeleton.humanoid_bones
    return float(origins[bones.index("head")][1] - origins[bones.index("leftFoot")][1])
