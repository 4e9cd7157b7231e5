"""BVH as a character: its hierarchy becomes nodes; there is no mesh, so exports get the stand-in body."""

from pathlib import Path

from roam_character.documents.bvh import BvhError, read_bvh
from roam_character.documents.gltf_document import GltfDocument
from roam_character.rigs.rig import Rig, RigError, rig_of_document

NO_MESH = "the file holds a skeleton and no mesh; GLB and USD show a plain body on it"


def read_bvh_rig(path: Path) -> Rig:
    """The zero pose of a BVH file: every rotation 0, the joints at their OFFSETs. Raises RigError."""
    try:
        clip = read_bvh(path)
    except BvhError as error:
        raise RigError(str(error), remedy="Export the BVH again with its HIERARCHY.") from error
    skeleton = clip.skeleton
    document = GltfDocument()
    for joint, name in enumerate(skeleton.joint_names):
        children = [c for c, parent in enumerate(skeleton.parents) if parent == joint]
        node = {"name": name, "translation": [float(v) for v in skeleton.rest_offsets[joint]]}
        document.add("nodes", {**node, **({"children": children} if children else {})})
    for tip in skeleton.tips:
        end = document.add("nodes", {"name": f"{tip.name}_end", "translation": [float(v) for v in tip.offset]})
        document.json["nodes"][tip.parent].setdefault("children", []).append(end)
    document.add("scenes", {"nodes": [0]})
    document.json["scene"] = 0
    return rig_of_document(document, name=path.name, format="bvh", notes=(NO_MESH,))
