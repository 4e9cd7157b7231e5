"""BVH as an export: the skeleton of a scene and its motion."""

from collections.abc import Sequence
from pathlib import Path

from roam_character.documents.bvh import read_bvh, write_bvh
from roam_character.formats.registry import Format
from roam_character.formats.scene import Scene
from roam_character.retargeting.rig_clip import rig_clip


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes the skeleton of a scene; meshes and furniture have no place in BVH."""
    write_bvh(path, scene.clip if scene.character is None else rig_clip(scene.character))
    return ("BVH holds the skeleton and its motion only: no mesh, no furniture",)


FORMAT = Format("bvh", "BVH (centimetres, degrees)", (".bvh",), write=write, read=lambda path: read_bvh(path))
