"""FBX to a glTF document, by ufbx. Run as a program in a process of its own: `python -m … FILE OUT.glb`.

ufbx's Python binding can end its process on some files, so nothing else may live there. Arrays are read whole through
numpy and checked against the counts that the file states.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from roam_character.documents.gltf_document import GltfDocument, decompose


def fbx_document(path: Path) -> GltfDocument:
    """Nodes, skinned meshes with normals, texture coordinates and plain materials; metres, +Y up.

    Raises ValueError with the reason when the file cannot be read.
    """
    import ufbx

    try:
        scene = ufbx.load_file(str(path), target_unit_meters=1.0, target_axes=ufbx.axes_right_handed_y_up)
    except ufbx.UfbxError as error:
        raise ValueError(str(error)) from error
    every = _items(scene.nodes)
    # Every attribute is asked for once: asking a node for its parent again and again ends the process (ufbx 0.0.5).
    above = [_parent(node) for node in every]
    nodes = {item: index for index, item in enumerate(i for i in range(len(every)) if above[i] is not None)}
    place = {every[item].element_id: index for item, index in nodes.items()}
    document = GltfDocument()
    for item in nodes:
        # The file's own root node holds its unit and axes: what hangs from it is given its whole placement instead.
        matrix = every[item].node_to_parent if above[item] in nodes else every[item].node_to_world
        document.add("nodes", _node(every[item].name, _matrix(matrix)))
    for item, index in nodes.items():
        owner = above[item]
        if owner is not None and owner in nodes:
            document.json["nodes"][nodes[owner]].setdefault("children", []).append(index)
    materials: dict[int, int] = {}
    for mesh in _items(scene.meshes):
        slots = []
        for material in _items(mesh.materials):  # the scene's own list of materials ends the process (ufbx 0.0.5)
            number = int(material.element_id)
            if number not in materials:
                materials[number] = document.material(material.name, _colour(material))
            slots.append(materials[number])
        _add_mesh(document, mesh, place, slots)
    document.add("scenes", {"nodes": [index for item, index in nodes.items() if above[item] not in nodes]})
    document.json["scene"] = 0
    return document


_KEPT: list[Any] = []  # ufbx 0.0.5 frees objects that are still in use: nothing is let go while the process lives


def _items(listed: Any) -> list[Any]:
    found = [listed[index] for index in range(len(listed))]
    _KEPT.extend((listed, *found))
    return found


def _array(listed: Any) -> np.ndarray:
    """A list of numbers or vectors as an array of its own."""
    _KEPT.append(listed)
    return np.asarray(listed).copy()


def _parent(node: Any) -> int | None:
    """Place of a node's parent in the scene's list; None for the file's root."""
    parent = node.parent
    _KEPT.append(parent)
    return None if parent is None else int(parent.typed_id)


def _node(name: str, matrix: np.ndarray) -> dict[str, Any]:
    translation, rotation, scale = decompose(matrix)
    return {
        "name": name,
        "translation": translation.tolist(),
        "rotation": rotation.tolist(),
        **({} if np.allclose(scale, 1, atol=1e-6) else {"scale": scale.tolist()}),
    }


def _matrix(matrix: Any) -> np.ndarray:
    columns = [[getattr(getattr(matrix, c), axis) for axis in "xyz"] for c in ("c0", "c1", "c2", "c3")]
    found = np.eye(4)
    found[:3, :] = np.array(columns).T
    return found


def _colour(material: Any) -> tuple[float, ...]:
    diffuse = material.fbx.diffuse_color
    texture, value = diffuse.texture, diffuse.value_vec4
    _KEPT.extend((diffuse, texture))
    if texture is not None:  # which is not read: the colour under it is often black and never meant to be seen
        return 0.8, 0.8, 0.8, 1.0
    return (*(float(np.clip(getattr(value, axis), 0, 1)) for axis in "xyz"), 1.0)


def _add_mesh(document: GltfDocument, mesh: Any, place: dict[int, int], materials: list[int]) -> None:
    """One glTF mesh with one primitive a material; corners become vertices of their own."""
    points, corners, faces = _array(mesh.vertices), _array(mesh.vertex_indices), _array(mesh.faces)
    instances = [(place[n.element_id], n) for n in _items(mesh.instances) if n.element_id in place]
    if len(points) != mesh.num_vertices or len(corners) != mesh.num_indices or not len(faces) or not instances:
        return
    if not np.isfinite(points).all() or corners.max() >= len(points) or faces.sum(axis=1).max() > len(corners):
        raise ValueError(f"mesh {mesh.name!r} has corners without points")
    slots, weights, joints, inverse = _skin(mesh, place)
    used = _array(mesh.face_material) if len(materials) > 1 else np.zeros(len(faces), int)
    primitives = []
    for slot in np.unique(used):
        triangles = _triangles(faces[used == slot])
        flat = triangles.reshape(-1)
        attributes = {"POSITION": document.accessor(points[corners[flat]], target=34962, bounds=True)}
        attributes |= _attribute(document, mesh, flat)
        if joints:
            attributes["JOINTS_0"] = document.accessor(slots[corners[flat]], "H", target=34962)
            attributes["WEIGHTS_0"] = document.accessor(weights[corners[flat]], target=34962)
        material = {"material": materials[slot]} if slot < len(materials) else {}
        primitives.append({"attributes": attributes, **material})
    shape = document.add("meshes", {"name": mesh.name or "mesh", "primitives": primitives})
    for index, node in instances:
        item: dict[str, Any] = {"mesh": shape}
        if joints:
            matrices = document.accessor(inverse.transpose(0, 2, 1))
            item["skin"] = document.add("skins", {"joints": joints, "inverseBindMatrices": matrices})
        geometry = _matrix(node.geometry_to_node)
        if joints or np.allclose(geometry, np.eye(4), atol=1e-6):
            document.json["nodes"][index] |= item
        else:
            part = document.add("nodes", {**_node("geometry", geometry), **item})
            document.json["nodes"][index].setdefault("children", []).append(part)


def _attribute(document: GltfDocument, mesh: Any, flat: np.ndarray) -> dict[str, int]:
    found = {}
    if mesh.vertex_normal.exists:
        normals = _array(mesh.vertex_normal.values)[_array(mesh.vertex_normal.indices)[flat]]
        lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
        normals = np.where(lengths > 1e-9, normals / np.maximum(lengths, 1e-9), [0.0, 1.0, 0.0])
        found["NORMAL"] = document.accessor(normals, target=34962)
    if mesh.vertex_uv.exists:
        places = _array(mesh.vertex_uv.values)[_array(mesh.vertex_uv.indices)[flat]]
        found["TEXCOORD_0"] = document.accessor(places * [1, -1] + [0, 1], target=34962)
    return found


def _triangles(faces: np.ndarray) -> np.ndarray:
    """Fans of polygons given by first corner and corner count [F, 2] -> corner numbers [T, 3]."""
    rows = [faces[:, 0:1] + np.array([[0, k, k + 1]]) for k in range(1, max(2, int(faces[:, 1].max()) - 1))]
    keep = [faces[:, 1] > k + 1 for k in range(1, len(rows) + 1)]
    return np.concatenate([row[mask] for row, mask in zip(rows, keep, strict=True)])


def _skin(mesh: Any, place: dict[int, int]) -> tuple[np.ndarray, np.ndarray, list[int], np.ndarray]:
    """Joint slots [V, 4], weights [V, 4], joint nodes, inverse bind matrices [K, 4, 4] of a mesh's first skin."""
    none = np.zeros((0, 4)), np.zeros((0, 4)), list[int](), np.zeros((0, 4, 4))
    if not len(mesh.skin_deformers):
        return none
    skin = mesh.skin_deformers[0]
    clusters = _items(skin.clusters)
    bones = [_bone(cluster) for cluster in clusters]
    if not clusters or any(bone not in place for bone in bones):
        return none
    slots, weights = np.zeros((mesh.num_vertices, 4), int), np.zeros((mesh.num_vertices, 4))
    pairs, rows = _array(skin.weights), _array(skin.vertices)
    for vertex, (begin, count) in enumerate(rows[:, :2].astype(int)):
        some = pairs[begin : begin + min(count, 4)]  # heaviest first
        slots[vertex, : len(some)], weights[vertex, : len(some)] = some[:, 0].astype(int), some[:, 1]
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 1e-9, weights / np.maximum(total, 1e-9), [1.0, 0, 0, 0])
    slots[weights == 0] = 0
    if len(rows) != mesh.num_vertices or slots.max() >= len(clusters):
        raise ValueError(f"the skin of mesh {mesh.name!r} does not fit it")
    inverse = np.stack([_matrix(c.geometry_to_bone) for c in clusters])
    return slots, weights, [place[bone] for bone in bones], inverse


def _bone(cluster: Any) -> int:
    node = cluster.bone_node
    _KEPT.append(node)
    return -1 if node is None else int(node.element_id)


def main(arguments: list[str]) -> int:
    """Writes the GLB, or {"error": …} on stdout with status 1."""
    try:
        Path(arguments[1]).write_bytes(fbx_document(Path(arguments[0])).to_bytes())
    except Exception as error:  # the caller only sees this process's end
        sys.stdout.write(json.dumps({"error": f"{error}"}))
        return 1
    return 0


if __name__ == "__main__":
    status = main(sys.argv[1:])
    sys.stdout.flush()
    os._exit(status)  # taking the library down in good order can end the process by a signal
