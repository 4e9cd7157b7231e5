"""The figure's mesh in a glTF document: one set of vertices, one primitive and material for each colour."""

from typing import Any

import numpy as np

from roam_character.documents.gltf_document import GltfDocument
from roam_character.figure.person import FigureMesh


def figure_primitives(
    document: GltfDocument, body: FigureMesh, joints: np.ndarray, *, scale: float = 1.0
) -> dict[str, Any]:
    """The mesh of the figure; `joints` [V, 4] are indices into its skin, `scale` file units a metre."""
    attributes = {
        "POSITION": document.accessor(body.vertices * scale, target=34962, bounds=True),
        "NORMAL": document.accessor(body.normals, target=34962),
        "JOINTS_0": document.accessor(np.where(body.weights > 0, joints, 0), "B", target=34962),
        "WEIGHTS_0": document.accessor(body.weights, target=34962),
    }
    primitives = []
    for surface in body.surfaces:
        look = {"roughnessFactor": surface.roughness}
        material = document.material(surface.name, (*(_linear(c) for c in surface.colour), 1.0), **look)
        indices = document.accessor(surface.faces.reshape(-1), "H", target=34963)
        primitives.append({"attributes": attributes, "indices": indices, "material": material})
    return {"name": "body", "primitives": primitives}


def _linear(value: float) -> float:
    """sRGB in 0..1 to the linear factors that glTF holds (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
