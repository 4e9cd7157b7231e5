"""The user's character in a glTF document: its own meshes, materials and skin, with our animation in front."""

import numpy as np

from roam_character.documents.gltf_document import GltfDocument, compose, decompose, node_matrix
from roam_character.figure.person import figure_mesh
from roam_character.formats.figure_gltf import figure_primitives
from roam_character.retargeting.onto_rig import RigMotion
from roam_character.retargeting.proportions import rest_positions


def character_document(motion: RigMotion, *, still: bool, name: str = "motion") -> GltfDocument:
    """The character's file with the motion as its first animation, rest pose in its nodes; `still`: posed nodes.

    A character without any mesh gets the stand-in body.
    """
    document = motion.fit.rig.document.copy()
    nodes = document.json["nodes"]
    for joint, node in enumerate(motion.fit.rig.nodes):
        if motion.driven[joint]:
            _as_parts(nodes[node])
    if not document.json.get("meshes"):
        _add_body(document, motion)
    if still:
        _pose_nodes(document, motion)
    else:
        _animate(document, motion, name)
    roots = document.scene_roots()
    if abs(motion.fit.scale - 1) > 1e-6:
        scale = [motion.fit.scale] * 3
        roots[:] = [document.add("nodes", {"name": "character", "scale": scale, "children": list(roots)})]
    return document


def _as_parts(node: dict[str, object]) -> None:
    """Translation, rotation and scale instead of a matrix: only those can be animated."""
    if "matrix" in node:
        place, turn, size = decompose(node_matrix(node))
        del node["matrix"]
        node |= {"translation": place.tolist(), "rotation": turn.tolist(), "scale": size.tolist()}


def _pose_nodes(document: GltfDocument, motion: RigMotion) -> None:
    for joint, node in enumerate(motion.fit.rig.nodes):
        if motion.driven[joint]:
            document.json["nodes"][node] |= {
                "translation": motion.translations[0, joint].tolist(),
                "rotation": motion.rotations[0, joint].tolist(),
                "scale": motion.scales[joint].tolist(),
            }


def _animate(document: GltfDocument, motion: RigMotion, name: str) -> None:
    """Tracks for what changes, or differs from the node's rest."""
    count = len(motion)
    times = document.accessor(np.arange(count) / motion.frame_rate, bounds=True)
    samplers: list[dict[str, object]] = []
    channels: list[dict[str, object]] = []

    def track(node: int, path: str, values: np.ndarray) -> None:
        samplers.append({"input": times, "output": document.accessor(values), "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

    for joint, node in enumerate(motion.fit.rig.nodes):
        if not motion.driven[joint]:
            continue
        place, turn, size = decompose(node_matrix(document.json["nodes"][node]))
        rows, places = motion.rotations[:, joint], motion.translations[:, joint]
        if np.abs(np.abs(rows @ turn) - 1).max() > 1e-7:
            track(node, "rotation", rows)
        reach = max(float(np.linalg.norm(place)), float(np.abs(places).max()), 1e-9)
        if np.abs(places - place).max() > 1e-4 * reach:
            track(node, "translation", places)
        if np.abs(motion.scales[joint] - size).max() > 1e-3 * np.abs(size).max():
            track(node, "scale", np.tile(motion.scales[joint], (count, 1)))
    if channels:
        animation = {"name": name, "samplers": samplers, "channels": channels}
        document.json["animations"] = [animation, *document.json.get("animations", [])]


def _add_body(document: GltfDocument, motion: RigMotion) -> None:
    """The figure, bound to the rig's joints as they stand in the T-pose."""
    fit = motion.fit
    body, places = figure_mesh(fit.skeleton), rest_positions(fit.skeleton)
    joint_of = {bone: joint for joint, bone in fit.carriers.items()}
    slots: list[int] = []
    for bone, parent in enumerate(fit.skeleton.parents):
        slots.append(joint_of.get(bone, slots[parent] if parent >= 0 else fit.bones["hips"]))
    inverse = []
    sizes = decompose(fit.rig.bind)[2]
    names = {joint: bone for bone, joint in fit.bones.items()}
    for joint in slots:
        place = places[fit.skeleton.index(names[joint])]
        place = place + (fit.hips_offset if names[joint] == "hips" else 0)
        inverse.append(np.linalg.inv(compose(place / fit.scale, fit.turns[joint], sizes[joint])))
    # A skin may name a node once only: bones that share a joint share its slot.
    unique = list(dict.fromkeys(slots))
    joints = np.array([unique.index(j) for j in slots])[body.joints]
    mesh = figure_primitives(document, body, joints, scale=1 / fit.scale)
    matrices = np.stack([inverse[slots.index(j)] for j in unique]).transpose(0, 2, 1)
    skin = {
        "joints": [fit.rig.nodes[j] for j in unique],
        "inverseBindMatrices": document.accessor(matrices),
    }
    node = {"name": "body", "mesh": document.add("meshes", mesh), "skin": document.add("skins", skin)}
    document.scene_roots().append(document.add("nodes", node))
