"""Makes the figure: `python -m roam_character.figure.generate [FILE]`, with the extra `figure` installed; some minutes.

Nothing in it is random: the same numbers in anatomy.py and garments.py give the same file.
"""

import sys
from pathlib import Path

import numpy as np

from roam_character.figure.garments import SHIRT, Piece, pieces
from roam_character.figure.modelling import Stance, modelling_stance
from roam_character.figure.person import FILE, STEP
from roam_character.figure.surface import triangles
from roam_character.figure.weights import Weights
from roam_character.skeleton import humanoid_skeleton

_HANGING = 0.35  # share of the thighs' pull that a shirt's hem follows; tuned by eye on sitting down


def t_pose_piece(piece: Piece, stance: Stance, weights: Weights) -> dict[str, np.ndarray]:
    """Vertices [V, 3] and normals [V, 3] in the T-pose, faces [F, 3] and skin weights [V, J] of a piece."""
    vertices, normals, faces = triangles(piece)
    skin = weights.at(vertices)
    if piece.material is SHIRT:
        skin = _hanging(skin, stance)
    turn = np.einsum("vj,jab->vab", skin, stance.turns)
    normals = np.einsum("vab,va->vb", turn, normals)
    return {
        "vertices": stance.to_t_pose(vertices, skin),
        "normals": normals / np.linalg.norm(normals, axis=-1, keepdims=True),
        "faces": faces,
        "weights": skin,
    }


def _hanging(skin: np.ndarray, stance: Stance) -> np.ndarray:
    skin = skin.copy()
    bones = stance.skeleton.humanoid_bones
    for side in ("leftUpperLeg", "rightUpperLeg"):
        pull = skin[:, bones.index(side)] * (1 - _HANGING)
        skin[:, bones.index(side)] -= pull
        skin[:, bones.index("hips")] += pull
    return skin


def main(path: Path) -> None:
    """Writes the file that `person.py` reads."""
    stance = modelling_stance(humanoid_skeleton())
    weights = Weights(stance)
    made = [(piece.material, t_pose_piece(piece, stance, weights)) for piece in pieces(stance)]
    materials = list(dict.fromkeys(material for material, _ in made))
    made.sort(key=lambda item: materials.index(item[0]))
    vertices, normals, skin = (np.concatenate([m[key] for _, m in made]) for key in ("vertices", "normals", "weights"))
    starts = np.cumsum([0] + [len(m["vertices"]) for _, m in made])
    faces = [m["faces"] + start for (_, m), start in zip(made, starts, strict=False)]
    order = np.argsort(-skin, axis=-1)[:, :4]
    shares = np.take_along_axis(skin, order, axis=-1)
    np.savez_compressed(
        path,
        vertices=np.round(vertices / STEP).astype(np.int16),
        normals=np.round(normals * 127).astype(np.int8),
        joints=np.where(shares > 0, order, 0).astype(np.uint8),
        weights=np.round(shares / shares.sum(axis=-1, keepdims=True) * 255).astype(np.uint8),
        faces=np.concatenate(faces).astype(np.uint16),
        counts=np.array([sum(len(m["faces"]) for one, m in made if one is material) for material in materials]),
        names=np.array([material.name for material in materials]),
        colours=np.array([material.colour for material in materials]),
        roughness=np.array([material.roughness for material in materials]),
    )
    print(f"{path}: {len(vertices)} vertices, {sum(map(len, faces))} triangles, {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE)
