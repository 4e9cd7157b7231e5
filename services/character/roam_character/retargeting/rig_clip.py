"""A rig's motion as a plain clip: the rig's own joint names on a T-pose with identity rotations, in metres as shown.

For formats that know only offsets and rotations (BVH, VRMA, CSV): every bone hangs from the bone before it in a human
body, so that its place follows from rotations alone, whatever the rig's tree is.
"""

import numpy as np

from roam_character.clip import Clip
from roam_character.documents.gltf_document import decompose
from roam_character.retargeting.onto_rig import RigMotion
from roam_character.retargeting.proportions import parent_bone, rest_positions
from roam_character.rigs.rig import HUMANOID_BONES
from roam_character.rotation import quat_inv, quat_mul, quat_rotate
from roam_character.skeleton import Skeleton


def rig_clip(motion: RigMotion, *, bones_only: bool = False) -> Clip:
    """The motion on a skeleton of the rig's joints.

    `bones_only`: the mapped bones alone, under their VRM names; else also what hangs from them (fingers, hair, twist
    joints), under the names of the file.
    """
    fit = motion.fit
    rig, bone_of = fit.rig, {joint: bone for bone, joint in fit.bones.items()}
    order = [fit.bones[bone] for bone in HUMANOID_BONES if bone in fit.bones]
    if not bones_only:
        order += [j for j in range(rig.joint_count) if motion.driven[j] and j not in bone_of]
        order = _parents_before(order, rig.parents, bone_of)
    place_of = {joint: place for place, joint in enumerate(order)}
    parents = []
    for joint in order:
        if joint in bone_of:
            bone = bone_of[joint]
            parents.append(-1 if bone == "hips" else place_of[fit.bones[parent_bone(bone, fit.bones)]])
        else:
            parents.append(place_of[rig.parents[joint]])
    turns, places = _frames(motion, order)
    offsets = _offsets(motion, order, parents, bone_of)
    rotations = turns.copy()
    for place, parent in enumerate(parents):
        if parent >= 0:
            rotations[:, place] = quat_mul(quat_inv(turns[:, parent]), turns[:, place])
    names = [bone_of[j] for j in order] if bones_only else _unique([rig.joint_names[j] for j in order])
    skeleton = Skeleton(
        joint_names=tuple(names),
        parents=tuple(parents),
        rest_offsets=offsets.astype(np.float32),
        rest_rotations=np.tile(np.array([0, 0, 0, 1], np.float32), (len(order), 1)),
        humanoid_bones=tuple(bone_of.get(j, "") for j in order),
        name=rig.name,
    )
    return Clip(skeleton, motion.frame_rate, places.astype(np.float32), rotations.astype(np.float32))


def _parents_before(order: list[int], parents: tuple[int, ...], bone_of: dict[int, str]) -> list[int]:
    """The bones, then every other joint after the one that it hangs from."""
    done = [j for j in order if j in bone_of]
    left = [j for j in order if j not in bone_of]
    while left:
        ready = [j for j in left if parents[j] in done]
        done += ready
        left = [j for j in left if j not in ready]
    return done


def _frames(motion: RigMotion, order: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """World rotations [T, K, 4] away from the T-pose, and places [T, 3] of the root [m]."""
    worlds = motion.worlds()[:, order]
    turns = decompose(worlds)[1]
    rest = np.broadcast_to(quat_inv(motion.fit.turns[order]), turns.shape)
    return quat_mul(turns, rest), worlds[:, 0, :3, 3]


def _offsets(motion: RigMotion, order: list[int], parents: list[int], bone_of: dict[int, str]) -> np.ndarray:
    """Offsets [K, 3] of the T-pose from each joint's parent [m]; the root's is where it stands above the floor."""
    fit = motion.fit
    rest, at = rest_positions(fit.skeleton), fit.rig.bind[:, :3, 3]
    bound = decompose(fit.rig.bind)[1]
    offsets = np.zeros((len(order), 3))
    for place, joint in enumerate(order):
        parent = order[parents[place]] if parents[place] >= 0 else -1
        if joint in bone_of:
            own = rest[fit.skeleton.index(bone_of[joint])]
            own = own + (fit.hips_offset if parent < 0 else 0)
            if parent >= 0:
                before = rest[fit.skeleton.index(bone_of[parent])]
                own = own - before - (fit.hips_offset if bone_of[parent] == "hips" else 0)
            offsets[place] = own
        else:
            swing = quat_mul(fit.turns[parent], quat_inv(bound[parent]))
            offsets[place] = quat_rotate(swing, at[joint] - at[parent]) * fit.scale
    return offsets


def _unique(names: list[str]) -> list[str]:
    """Names without repetition: the second `end` becomes `end_2`."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        found.append(name if seen[name] == 1 else f"{name}_{seen[name]}")
    return found
