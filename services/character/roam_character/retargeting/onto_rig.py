"""Poses and motions of a fitted skeleton on the character's own joints.

Every mapped joint gets the world orientation of its bone times its rotation in the T-pose, and the bone's place. Where
the rig's tree is ours, places follow from rotations; where it is not (thighs below the spine, feet below the root,
several spine joints for one of ours) the joint's translation is animated too, so that hands and feet are where the
pose has them. Everything below a bone (fingers, hair, props) stays as it is bound; twist joints take their part of the
twist.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from roam_character.clip import Clip
from roam_character.documents.gltf_document import compose, decompose, node_matrix
from roam_character.pose import Pose
from roam_character.retargeting.proportions import Fit
from roam_character.rigs.words import words_of
from roam_character.rotation import quat_from_rotvec, quat_inv, quat_mul, quat_normalize, quat_slerp

_TRUNK = ("hips", "spine", "chest", "upperChest", "neck", "head")
_MOVES = 5e-4  # a translation that varies more than this part of the figure's height is animated


@dataclass(frozen=True, eq=False)
class RigMotion:
    """T frames of the rig's N joints, as local transforms of the file's nodes."""

    fit: Fit
    frame_rate: float
    translations: np.ndarray  # [T, N, 3] in the file's units
    rotations: np.ndarray  # [T, N, 4], signs without jumps
    scales: np.ndarray  # [N, 3]
    moved: np.ndarray  # [N] bool: the translation changes from frame to frame
    driven: np.ndarray  # [N] bool: this joint is a bone, or hangs from one

    def __len__(self) -> int:
        return len(self.translations)

    def worlds(self) -> np.ndarray:
        """World placements of all joints as shown [T, N, 4, 4] [m], from the local ones, as any reader has them."""
        rig = self.fit.rig
        outer = _outer(self.fit)
        local = compose(self.translations, self.rotations, np.broadcast_to(self.scales, self.translations.shape))
        worlds = np.zeros_like(local)
        for joint, parent in enumerate(rig.parents):
            worlds[:, joint] = (outer[joint] if parent < 0 else worlds[:, parent]) @ local[:, joint]
        return np.diag([self.fit.scale] * 3 + [1.0]) @ worlds


def onto_rig(fit: Fit, content: Clip | Pose) -> RigMotion:
    """A pose or a motion of `fit.skeleton` on the rig. ValueError for another skeleton."""
    if content.skeleton != fit.skeleton:
        raise ValueError("the pose is of another skeleton; solve it for this character's, or carry it over first")
    single = isinstance(content, Pose)
    roots = content.root_position[None] if isinstance(content, Pose) else content.root_positions
    posture = content.posture()
    places, turns = (np.asarray(a, float)[None] if single else np.asarray(a, float) for a in posture)
    worlds = _worlds(fit, places, quat_normalize(turns))
    rate = 30.0 if isinstance(content, Pose) else content.frame_rate
    return _local(fit, worlds, rate, len(roots))


def _worlds(fit: Fit, places: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """World placements [T, N, 4, 4] in the file's units of all joints."""
    rig, count = fit.rig, len(places)
    _, _, sizes = decompose(rig.bind)
    worlds = np.tile(rig.rest, (count, 1, 1, 1))
    bound = np.stack([_bind_local(fit, joint) for joint in range(rig.joint_count)])
    of_joint = {joint: bone for bone, joint in fit.bones.items()}
    between, twists = _between(fit), _twists(fit)
    driven = _driven(fit)
    for joint in range(rig.joint_count):
        parent = rig.parents[joint]
        if joint in of_joint:
            turn = quat_mul(turns[:, fit.carriers[joint]], np.broadcast_to(fit.turns[joint], (count, 4)))
            place = places[:, fit.skeleton.index(of_joint[joint])]
            if of_joint[joint] == "hips":
                place = place + _rotated(turns[:, 0], fit.hips_offset)
            worlds[:, joint] = compose(place / fit.scale, turn, np.broadcast_to(sizes[joint], (count, 3)))
        elif driven[joint]:
            worlds[:, joint] = worlds[:, parent] @ bound[joint]
            if joint in between:
                one, two, part = between[joint]
                worlds[:, joint] = _reoriented(
                    worlds[:, joint], quat_slerp(turns[:, one], turns[:, two], part), fit.turns[joint]
                )
            elif joint in twists:
                worlds[:, joint] = _reoriented(worlds[:, joint], _twisted(turns, twists[joint]), fit.turns[joint])
    return worlds


def _rotated(turns: np.ndarray, vector: np.ndarray) -> np.ndarray:
    axis, w = turns[..., :3], turns[..., 3:]
    twice = 2 * np.cross(axis, vector)
    return np.asarray(vector + w * twice + np.cross(axis, twice))


def _reoriented(world: np.ndarray, orientation: np.ndarray, rest: np.ndarray) -> np.ndarray:
    place, _, size = decompose(world)
    return compose(place, quat_mul(orientation, np.broadcast_to(rest, orientation.shape)), size)


def _bind_local(fit: Fit, joint: int) -> np.ndarray:
    parent = fit.rig.parents[joint]
    if parent < 0:
        return fit.rig.bind[joint]
    return np.asarray(np.linalg.inv(fit.rig.bind[parent]) @ fit.rig.bind[joint])


def _driven(fit: Fit) -> np.ndarray:
    """[N] joints that are bones or hang from one."""
    bones, found = set(fit.bones.values()), np.zeros(fit.rig.joint_count, bool)
    for joint, parent in enumerate(fit.rig.parents):
        found[joint] = joint in bones or (parent >= 0 and found[parent])
    return found


def _between(fit: Fit) -> dict[int, tuple[int, int, float]]:
    """Trunk joints of the rig between two of ours -> those two and how far along they are (0 to 1)."""
    found: dict[int, tuple[int, int, float]] = {}
    chain = [bone for bone in _TRUNK if bone in fit.bones]
    for one, two in pairwise(chain):
        way = fit.rig.path(fit.bones[one], fit.bones[two])[1:-1]
        ends = fit.carriers[fit.bones[one]], fit.carriers[fit.bones[two]]
        found |= {joint: (*ends, (i + 1) / (len(way) + 1)) for i, joint in enumerate(way)}
    return found


@dataclass(frozen=True)
class _Twist:
    """A joint that takes a part of a limb's turn about its own axis."""

    upper: int  # joints of the skeleton: the turn of `lower` against `upper` is shared out
    lower: int
    base: int  # that it hangs from
    axis: tuple[float, float, float]
    part: float  # of that turn, from the base's orientation on


def _twists(fit: Fit) -> dict[int, _Twist]:
    """Twist joints below upper arms, forearms, thighs and shins."""
    skeleton, found = fit.skeleton, dict[int, _Twist]()
    at = fit.rig.bind[:, :3, 3]
    for side in ("left", "right"):
        out = (1.0, 0.0, 0.0) if side == "left" else (-1.0, 0.0, 0.0)
        limbs = (("Shoulder", "UpperArm", "LowerArm", out), ("UpperArm", "LowerArm", "Hand", out),
                 ("hips", "UpperLeg", "LowerLeg", (0.0, -1.0, 0.0)),
                 ("UpperLeg", "LowerLeg", "Foot", (0.0, -1.0, 0.0)))  # fmt: skip
        for before, bone, after, axis in limbs:
            top, end = fit.bones[side + bone], fit.bones[side + after]
            joints = {name: skeleton.index(name if name == "hips" else side + name) for name in (before, bone, after)}
            length = float(np.linalg.norm(at[end] - at[top]))
            for joint in fit.rig.children[top]:
                if joint in fit.bones.values() or not {"twist", "roll"} & set(words_of(fit.rig.joint_names[joint])):
                    continue
                along = float(np.clip((at[joint] - at[top]) @ (at[end] - at[top]) / length**2, 0, 1))
                if bone.startswith("Upper"):  # the joint itself turns fully: near the trunk some of it is taken back
                    found[joint] = _Twist(joints[before], joints[bone], joints[bone], axis, along - 1.0)
                else:
                    found[joint] = _Twist(joints[bone], joints[after], joints[bone], axis, along)
    return found


def _twisted(turns: np.ndarray, twist: _Twist) -> np.ndarray:
    """World orientations [T, 4] of our bone with its part of the twist."""
    relative = quat_mul(quat_inv(turns[:, twist.upper]), turns[:, twist.lower])
    axis = np.array(twist.axis)
    angle = 2 * np.arctan2(relative[:, :3] @ axis, relative[:, 3])
    angle = (angle + np.pi) % (2 * np.pi) - np.pi
    return quat_mul(turns[:, twist.base], quat_from_rotvec(axis * (twist.part * angle)[:, None]))


def _outer(fit: Fit) -> dict[int, np.ndarray]:
    """What stands above the root joints: nodes of the file that are no joints."""
    rig = fit.rig
    nodes = rig.document.json["nodes"]
    return {
        joint: rig.rest[joint] @ np.linalg.inv(node_matrix(nodes[rig.nodes[joint]]))
        for joint, parent in enumerate(rig.parents) if parent < 0
    }  # fmt: skip


def _local(fit: Fit, worlds: np.ndarray, rate: float, count: int) -> RigMotion:
    rig, driven = fit.rig, _driven(fit)
    nodes, outer = rig.document.json["nodes"], _outer(fit)
    translations, rotations = np.zeros((count, rig.joint_count, 3)), np.zeros((count, rig.joint_count, 4))
    scales, moved = np.ones((rig.joint_count, 3)), np.zeros(rig.joint_count, bool)
    size = float(np.ptp(rig.bind[:, 1, 3])) or 1.0
    for joint, parent in enumerate(rig.parents):
        above = outer[joint] if parent < 0 else worlds[:, parent]
        local = np.linalg.inv(above) @ worlds[:, joint] if driven[joint] else node_matrix(nodes[rig.nodes[joint]])
        place, turn, scale = decompose(np.broadcast_to(local, (count, 4, 4)))
        still = decompose(_bind_local(fit, joint))[0] if driven[joint] and parent >= 0 else place[0]
        # lengths of local translations are in the parent's scale
        unit = float(np.abs(decompose(np.asarray(above)[0] if np.ndim(above) == 3 else above)[2]).mean())
        moved[joint] = driven[joint] and float(np.abs(place - still).max()) * unit > _MOVES * size
        if not moved[joint]:
            place = np.broadcast_to(still, place.shape)
        translations[:, joint], rotations[:, joint], scales[joint] = place, turn, scale.mean(axis=0)
    return RigMotion(fit, rate, translations, continuous(rotations), scales, moved, driven)


def continuous(rotations: np.ndarray) -> np.ndarray:
    """Quaternions [T, ..., 4] whose signs do not jump from frame to frame: q and -q are one rotation."""
    dots = np.sum(rotations[1:] * rotations[:-1], axis=-1)
    signs = np.concatenate([np.ones((1, *dots.shape[1:])), np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)])
    return np.asarray(rotations * signs[..., None])


def back_from_rig(motion: RigMotion) -> Clip:
    """The motion read back from the rig's joints as the skeleton's: what the round trip is measured with.

    Bones that the rig lacks keep the orientation of the bone before them.
    """
    fit, worlds = motion.fit, motion.worlds()
    skeleton = fit.skeleton
    turns = decompose(worlds)[1]
    joint_of = {bone: joint for joint, bone in fit.carriers.items()}
    orientations = np.zeros((len(motion), skeleton.joint_count, 4))
    for bone, parent in enumerate(skeleton.parents):
        if bone in joint_of:
            joint = joint_of[bone]
            own = np.broadcast_to(quat_inv(fit.turns[joint]), (len(motion), 4))
            orientations[:, bone] = quat_mul(turns[:, joint], own)
        else:
            orientations[:, bone] = orientations[:, parent]
    rotations = orientations.copy()
    parents = list(skeleton.parents[1:])
    rotations[:, 1:] = quat_mul(quat_inv(orientations[:, parents]), orientations[:, 1:])
    hips = worlds[:, fit.bones["hips"], :3, 3] - _rotated(orientations[:, 0], fit.hips_offset)
    return Clip(skeleton, motion.frame_rate, hips.astype(np.float32), rotations.astype(np.float32))
