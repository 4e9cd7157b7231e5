"""Skin weights by diffusion inside the body.

Every cell of a grid inside the figure belongs to one bone; then ownership spreads among neighbouring cells, farther
where joints should bend softly. Because it spreads inside only, a hand beside the thigh gets nothing of it.
"""

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from roam_character.figure import anatomy
from roam_character.figure.modelling import Stance
from roam_character.figure.solids import Solid, blend, mirrored, thicker

_CELL = 0.010  # [m]
_INFLUENCES = 4  # bones a vertex: what JOINTS_0 and WEIGHTS_0 hold
_STEPS = 60  # rounds of diffusion: spreads by about _CELL · sqrt(_STEPS · softness / 3)
# How softly the parts bend, 0..1; tuned by eye on sitting, lying and walking.
_SOFTNESS = {"torso": 1.0, "girdle": 0.6, "arm": 0.22, "hand": 0.12, "leg": 0.45, "foot": 0.12, "head": 0.30}


class Weights:
    """Weights [N, J] at any points of the modelling stance."""

    def __init__(self, stance: Stance) -> None:
        low, high = np.array([-0.66, -0.02, -0.32]), np.array([0.66, 1.74, 0.50])
        size = np.ceil((high - low) / _CELL).astype(int)
        cells = (low + (np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), -1) + 0.5) * _CELL).reshape(-1, 3)
        owner, inside, softness = _owners(stance, cells)
        kept = np.flatnonzero(inside)
        self._tree = cKDTree(cells[kept])
        links = self._tree.sparse_distance_matrix(self._tree, 1.01 * _CELL, output_type="coo_matrix").tocsr()
        links.data[:] = 1.0
        weights = np.zeros((len(kept), stance.skeleton.joint_count))
        weights[np.arange(len(kept)), owner[kept]] = 1.0
        rate, neighbours = softness[kept, None] / 6, np.asarray(links.sum(axis=1)).reshape(-1, 1)
        for _ in range(_STEPS):
            weights += rate * (links @ weights - neighbours * weights)
        self._values = weights

    def at(self, points: np.ndarray) -> np.ndarray:
        """The `_INFLUENCES` greatest weights, summing to 1; those of the cells around a point are averaged."""
        far, cells = map(np.asarray, self._tree.query(points, k=8))
        near = np.maximum(1.8 * _CELL + far[:, :1] - far, 0)
        found = np.einsum("nk,nkj->nj", near / near.sum(axis=-1, keepdims=True), self._values[cells])
        least = np.sort(found, axis=-1)[:, -_INFLUENCES][:, None]
        found = np.where((found >= least) & (found > 0.004), found, 0)
        return np.asarray(found / found.sum(axis=-1, keepdims=True))


def _owners(stance: Stance, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bone of every cell [N], which lie inside [N], and how softly they bend [N]."""
    parts = _parts(stance)
    distances = np.stack([solid(points) for _, _, solid in parts])
    nearest = distances.argmin(axis=0)
    owner = np.zeros(len(points), int)
    softness = np.zeros(len(points))
    for index, (part, bones, _) in enumerate(parts):
        mine = nearest == index
        owner[mine] = _along(stance, bones, points[mine])
        softness[mine] = _SOFTNESS[part]
    return owner, distances.min(axis=0) < 0.5 * _CELL, softness


def _parts(stance: Stance) -> list[tuple[str, tuple[str, ...], Solid]]:
    """Kind, bones from root to tip, and solid of each part of the body."""
    found: list[tuple[str, tuple[str, ...], Solid]] = [
        ("torso", ("hips", "spine", "chest", "upperChest"), anatomy.torso()),
        ("head", ("neck", "head"), blend([anatomy.head(), anatomy.neck()], 0.03)),
    ]
    left: list[tuple[str, tuple[str, ...], str, Solid]] = [
        ("girdle", ("Shoulder",), "Shoulder", anatomy.shoulder_girdle()),
        ("arm", ("UpperArm",), "UpperArm", anatomy.upper_arm()),
        ("arm", ("LowerArm",), "LowerArm", anatomy.forearm()),
        ("hand", ("Hand",), "Hand", anatomy.hand()),
        ("leg", ("UpperLeg",), "UpperLeg", thicker(anatomy.thigh(), 0.004)),
        ("leg", ("LowerLeg",), "LowerLeg", thicker(anatomy.shank(), 0.004)),
        ("foot", ("Foot", "Toes"), "Foot", anatomy.foot()),
    ]
    for kind, bones, carrier, solid in left:
        for side, one in (("left", solid), ("right", mirrored(solid))):
            found.append((kind, tuple(f"{side}{bone}" for bone in bones), stance.carried(f"{side}{carrier}", one)))
    return found


def _along(stance: Stance, bones: tuple[str, ...], points: np.ndarray) -> np.ndarray:
    """The bone of a chain that each point lies beside: planes across the chain at its joints divide it."""
    joints = [stance.skeleton.humanoid_bones.index(bone) for bone in bones]
    owner = np.full(len(points), joints[0])
    for before, joint in pairwise(joints):
        axis = stance.places[joint] - stance.places[before]
        owner[(points - stance.places[joint]) @ axis > 0] = joint
    return owner
