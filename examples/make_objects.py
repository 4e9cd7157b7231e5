"""Makes the furniture in examples/objects: pieces of the procedural generator that no training run has seen.

    .venv/bin/python examples/make_objects.py

Metres, +Y up, standing on y = 0, seat facing +Z. The same code makes the same bytes.
"""

from pathlib import Path

import trimesh
from roam_goalpose.furniture.catalog import generate

OBJECTS = Path(__file__).parent / "objects"

# name -> (category, number); training draws its numbers far below 900,000
PIECES = {
    "chair": ("chair", 900_004),
    "upholstered_chair": ("chair", 900_005),
    "armchair": ("armchair", 900_005),
    "sofa": ("sofa", 900_031),
    "bench": ("bench", 900_001),
    "stool": ("stool", 900_003),
    "office_chair": ("officechair", 900_007),
}


def glb_of(category: str, number: int) -> bytes:
    """One piece as a GLB file."""
    vertices, faces = generate(category, number).mesh
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    data = mesh.export(file_type="glb", include_normals=False)
    assert isinstance(data, bytes)
    return data


def main(folder: Path = OBJECTS) -> None:
    """Writes every piece."""
    folder.mkdir(exist_ok=True)
    for name, (category, number) in PIECES.items():
        path = folder / f"{name}.glb"
        path.write_bytes(glb_of(category, number))
        print(f"{path.name}: {category} {number}, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
