"""VRM Animation (`VRMC_vrm_animation` 1.0): bones of a T-pose under VRM names, LINEAR keys.

The nodes hold the T-pose of the character's own proportions with identity rotations; readers scale the hips' way by the
ratio of hips heights, so a motion made for a character fits that character and only nears others.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from roam_character.clip import Clip
from roam_character.documents.gltf_document import GltfDocument
from roam_character.formats.registry import Format
from roam_character.formats.scene import Scene
from roam_character.retargeting.onto_rig import RigMotion, continuous
from roam_character.retargeting.rig_clip import rig_clip

_LENGTH = 2.0  # [s] of a still pose: some players show nothing of a clip without length


def vrma_document(clip: Clip) -> GltfDocument:
    """The animation of a clip whose joints carry VRM bone names."""
    skeleton, document = clip.skeleton, GltfDocument()
    bones = [j for j, bone in enumerate(skeleton.humanoid_bones) if bone]
    place = {joint: index for index, joint in enumerate(bones)}
    for joint in bones:
        children = [place[c] for c in bones if skeleton.parents[c] == joint]
        node = {
            "name": skeleton.humanoid_bones[joint],
            "translation": [float(v) for v in skeleton.rest_offsets[joint]],
            "rotation": [0.0, 0.0, 0.0, 1.0],
        }
        document.add("nodes", {**node, **({"children": children} if children else {})})
    document.add("scenes", {"nodes": [0]})
    document.json["scene"] = 0
    turns = np.asarray(clip.rotations, float)
    turns = continuous(turns / np.linalg.norm(turns, axis=-1, keepdims=True))
    times = document.accessor(np.arange(len(clip)) / clip.frame_rate, bounds=True)
    samplers: list[dict[str, object]] = []
    channels: list[dict[str, object]] = []
    tracks = [(0, "translation", clip.root_positions)]
    tracks += [(place[joint], "rotation", turns[:, joint]) for joint in bones]
    for target, path, values in tracks:
        samplers.append({"input": times, "output": document.accessor(values), "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": target, "path": path}})
    document.add("animations", {"name": "motion", "samplers": samplers, "channels": channels})
    human = {skeleton.humanoid_bones[joint]: {"node": place[joint]} for joint in bones}
    document.json["extensions"] = {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": {"humanBones": human}}}
    document.json["extensionsUsed"] = ["VRMC_vrm_animation"]
    return document


def _own_height(motion: RigMotion) -> Clip:
    """The character's bones; its hips rest as high as in its file, so that readers' ratio of heights is 1 on it."""
    clip, fit = rig_clip(motion, bones_only=True), motion.fit
    offsets = clip.skeleton.rest_offsets.copy()
    offsets[0, 1] = fit.rig.rest[fit.bones["hips"], 1, 3] * fit.scale
    return replace(clip, skeleton=replace(clip.skeleton, rest_offsets=offsets))


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes the bones of a scene. A still pose is held for two seconds."""
    clip = scene.clip if scene.character is None else _own_height(scene.character)
    if len(clip) == 1:
        roots, turns = (np.repeat(a, 2, axis=0) for a in (clip.root_positions, clip.rotations))
        clip = Clip(clip.skeleton, 1 / _LENGTH, roots, turns)
    path.write_bytes(vrma_document(clip).to_bytes())
    return ("VRMA holds the humanoid bones only: no mesh, no furniture",)


FORMAT = Format("vrma", "VRM Animation 1.0", (".vrma",), write=write)
