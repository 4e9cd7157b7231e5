"""A character's proportions: its T-pose, whatever pose it is bound in, and a Skeleton of 22 joints with its lengths.

Every limb of the bind pose is turned the shortest way into the T-pose (arms along ±X, legs straight down, feet ahead),
joint by joint from the trunk outwards, so that bent elbows and A-poses become hinges' turns. Identity in the skeleton
is that T-pose; `Fit.turns` are the world rotations of the character's own joints in it.

Bones that the rig lacks stand a millimetre from the next one that it has, so that turning them moves nothing else; the
joint before them takes over their rotation.
"""

from dataclasses import dataclass

import numpy as np

from roam_character.documents.gltf_document import GltfError, decompose
from roam_character.rigs.mapping import BoneMap
from roam_character.rigs.rig import HUMANOID_BONES, Rig, RigError
from roam_character.rotation import quat_between, quat_from_matrix, quat_mul, quat_normalize, quat_rotate
from roam_character.skeleton import Skeleton, Tip, humanoid_skeleton

STATURE = 1.70  # [m] a figure of no human size is shown as
SMALLEST, TALLEST = 0.9, 2.3  # [m] statures that are believed: a small child, the tallest people
_STUB = 1e-3  # [m] between a bone that the rig lacks and the one whose place it takes
_HEAD_JOINT = 0.87  # height of the head's joint as a part of stature: 1.47 of 1.69 m in skeletons/humanoid.json
_LEAN = np.cos(np.radians(12))  # a trunk that leans more is put upright: people's own curvature is below 8 degrees


@dataclass(frozen=True, eq=False)
class Fit:
    """A rig and its map made ready for poses of `skeleton`."""

    rig: Rig
    bones: dict[str, int]  # VRM bone -> joint of the rig
    skeleton: Skeleton  # 22 joints, metres as shown
    scale: float  # shown metres for one metre of the file
    turns: np.ndarray  # [N, 4] world rotations of the rig's joints in the T-pose
    carriers: dict[int, int]  # joint of the rig -> joint of the skeleton whose orientation it takes
    hips_offset: np.ndarray  # [3] from the skeleton's hips to the rig's, in the hips' frame [m]
    notes: tuple[str, ...]

    @property
    def height(self) -> float:
        """Stature as shown: the top of the head above the soles [m]."""
        head = self.skeleton.index("head")
        top = next(t.offset[1] for t in self.skeleton.tips if t.parent == head)
        return float(rest_positions(self.skeleton)[head, 1] + top)


def rest_positions(skeleton: Skeleton) -> np.ndarray:
    """Joint positions [J, 3] of the T-pose [m]."""
    places = np.zeros((skeleton.joint_count, 3))
    for joint, parent in enumerate(skeleton.parents):
        places[joint] = skeleton.rest_offsets[joint] + (places[parent] if parent >= 0 else 0)
    return places


def fit(rig: Rig, bone_map: BoneMap, *, height: float | None = None) -> Fit:
    """The T-pose and the proportions of a rig.

    `height` [m] is the stature to show it in; without it the file's own is kept when people are as tall, else 1.70 m is
    taken and said. Raises RigError when its bones have no length.
    """
    shape = _Straightened(rig, bone_map.bones)
    stature = shape.positions["head"][1] / _HEAD_JOINT
    notes = list(rig.notes)
    if not stature > 0:
        raise RigError(f"{rig.name} has no height: its head lies below its soles", remedy="Check its bind pose.")
    scale = 1.0
    if height is not None:
        scale = height / stature
    elif not SMALLEST <= stature <= TALLEST:
        scale = STATURE / stature
        said = "would be" if rig.format == "bvh" else "is"  # a BVH file states no unit
        notes.append(f"{rig.name} {said} {stature:.2f} m tall as read; it is shown {STATURE:.2f} m tall (--height)")
    skeleton, carriers = _skeleton(shape, rig, bone_map.bones, scale)
    hips_offset = (shape.positions["hips"] - shape.our_hips) * scale
    return Fit(rig, dict(bone_map.bones), skeleton, scale, shape.turns, carriers, hips_offset, tuple(notes))


class _Straightened:
    """The bind pose turned into the T-pose: world turns of all joints, positions of the mapped ones, soles at 0."""

    def __init__(self, rig: Rig, bones: dict[str, int]) -> None:
        self.rig, self.bones = rig, bones
        self.at = rig.bind[:, :3, 3]
        self.frame = self._frame()
        self.swings = self._swings()
        bound = decompose(rig.bind)[1]
        self.turns = quat_normalize(quat_mul(self._swing_of_all(), bound))
        self.positions = self._positions()
        floor = self._floor()
        for bone in self.positions:
            self.positions[bone] = self.positions[bone] - [0, floor, 0]
        middle = (self.positions["leftUpperLeg"] + self.positions["rightUpperLeg"]) / 2
        legs = sum(
            float(np.linalg.norm(self.positions[f"{s}{a}"] - self.positions[f"{s}{b}"])) / 2
            for s in ("left", "right") for a, b in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"))
        )  # fmt: skip
        # Rigs put their hips joint anywhere about the pelvis: ours lies as high over the thighs as the humanoid's.
        self.our_hips = middle + np.array([0, 0.06 / 0.82 * legs, 0])

    def _frame(self) -> np.ndarray:
        """Rotation from the bind pose's space to the character's: left +X, up +Y, ahead +Z."""
        at, bones = self.at, self.bones
        legs, arms = (at[bones[f"left{b}"]] - at[bones[f"right{b}"]] for b in ("UpperLeg", "UpperArm"))
        across = _unit(legs) + _unit(arms)
        trunk = sum(at[bones[f"{s}UpperArm"]] - at[bones[f"{s}UpperLeg"]] for s in ("left", "right"))
        up = np.array([0.0, 1.0, 0.0])
        if _unit(trunk) @ up < _LEAN:
            up = _unit(trunk)
        left = _unit(across - (across @ up) * up)
        turn = np.stack([left, up, np.cross(left, up)])  # rows: bind space -> character
        return quat_from_matrix(turn)

    def _direction(self, bone: str, end: int | None) -> np.ndarray | None:
        if bone not in self.bones or end is None:
            return None
        step = self.at[end] - self.at[self.bones[bone]]
        return quat_rotate(self.frame, _unit(step)) if np.linalg.norm(step) > 1e-9 else None

    def _swings(self) -> dict[str, np.ndarray]:
        """World rotation of every mapped bone from the bind pose to the T-pose."""
        found = dict.fromkeys((b for b in self.bones if not b.startswith(("left", "right"))), self.frame)
        for side, outwards in (("left", 1.0), ("right", -1.0)):
            ahead = np.array([outwards, 0.0, 0.0])
            chain: tuple[tuple[str, str, np.ndarray], ...] = (
                ("UpperArm", "LowerArm", ahead), ("LowerArm", "Hand", ahead),
                ("UpperLeg", "LowerLeg", np.array([0.0, -1, 0])), ("LowerLeg", "Foot", np.array([0.0, -1, 0])),
            )  # fmt: skip
            if f"{side}Shoulder" in self.bones:
                found[f"{side}Shoulder"] = self.frame
            before = self.frame
            for bone, end, wanted in chain:
                before = self.frame if bone.startswith("Upper") else before
                before = self._turned(side + bone, self.bones[side + end], before, wanted)
                found[side + bone] = before
                if bone == "LowerArm":
                    found[f"{side}Hand"] = self._hand(side, before, ahead)
            found[f"{side}Foot"] = found[f"{side}Toes"] = self._foot(side)
        return {bone: turn for bone, turn in found.items() if bone in self.bones}

    def _turned(self, bone: str, end: int, before: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """The rotation of the bone before, and what then brings this one the shortest way to `wanted`."""
        step = self.at[end] - self.at[self.bones[bone]]
        if np.linalg.norm(step) < 1e-9:
            raise RigError(f"{self.rig.name}: {bone} has no length", remedy="Name other joints with --map FILE.")
        return quat_mul(quat_between(quat_rotate(before, _unit(step)), wanted), before)

    def _hand(self, side: str, before: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Hands follow their forearm, and are straightened where fingers tell which way they point."""
        hand = self.bones[f"{side}Hand"]
        ends = [self.at[j] - self.at[hand] for j in self.rig.children[hand]]
        ends = [e for e in ends if np.linalg.norm(e) > 1e-6]
        if len(ends) < 2:
            return before
        pointing = quat_rotate(before, _unit(np.sum(ends, axis=0)))
        return quat_mul(quat_between(pointing, ahead), before) if pointing @ ahead > 0.7 else before

    def _foot(self, side: str) -> np.ndarray:
        """Feet stay as flat as they are bound, and point straight ahead."""
        direction = self._direction(f"{side}Foot", self._foot_end(side))
        if direction is None or np.hypot(direction[0], direction[2]) < 0.2:
            return self.frame
        return quat_mul(quat_between(_unit(direction * [1, 0, 1]), np.array([0.0, 0.0, 1.0])), self.frame)

    def _foot_end(self, side: str) -> int | None:
        foot = self.bones[f"{side}Foot"]
        if f"{side}Toes" in self.bones:
            return self.bones[f"{side}Toes"]
        ends = self.rig.children[foot]
        return max(ends, key=lambda j: float(np.linalg.norm(self.at[j] - self.at[foot])), default=None)

    def _swing_of_all(self) -> np.ndarray:
        """[N, 4]: unmapped joints move with the nearest mapped joint above them, the topmost ones with the trunk."""
        swings = np.tile(self.frame, (self.rig.joint_count, 1))
        of_joint = {self.bones[bone]: swing for bone, swing in self.swings.items()}
        for joint in range(self.rig.joint_count):
            parent = self.rig.parents[joint]
            swings[joint] = of_joint.get(joint, swings[parent] if parent >= 0 else self.frame)
        return swings

    def _positions(self) -> dict[str, np.ndarray]:
        """Joints of the T-pose, each from the mapped one before it; the hips stay where they are bound."""
        found: dict[str, np.ndarray] = {"hips": quat_rotate(self.frame, self.at[self.bones["hips"]])}
        for bone in HUMANOID_BONES[1:]:
            if bone not in self.bones:
                continue
            before = parent_bone(bone, self.bones)
            step = self.at[self.bones[bone]] - self.at[self.bones[before]]
            found[bone] = found[before] + quat_rotate(self.swings[before], step)
        return found

    def _floor(self) -> float:
        """Height of the soles in the T-pose: the lowest vertices of the feet, or the lowest joints."""
        lows = []
        for side in ("left", "right"):
            foot = self.bones[f"{side}Foot"]
            points = [(p - self.at[foot]) for p in self._foot_points(foot)]
            turned = quat_rotate(np.asarray(self.swings[f"{side}Foot"]), np.array(points))
            lows.append(float(self.positions[f"{side}Foot"][1] + turned[:, 1].min()))
        return min(lows)

    def _foot_points(self, foot: int) -> np.ndarray:
        below, stack = [foot], [*self.rig.children[foot]]
        while stack:
            below.append(stack.pop())
            stack += self.rig.children[below[-1]]
        points = bound_points(self.rig, set(below))
        return points if len(points) else self.at[below]


def _unit(vector: np.ndarray) -> np.ndarray:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))


def parent_bone(bone: str, bones: dict[str, int]) -> str:
    """The humanoid bone before another one, of those that a rig has."""
    skeleton = humanoid_skeleton()
    while True:
        bone = skeleton.joint_names[skeleton.parents[skeleton.index(bone)]]
        if bone in bones:
            return bone


def bound_points(rig: Rig, joints: set[int]) -> np.ndarray:
    """Vertices [V, 3] that move mainly with some joints, where they are in the bind pose [m]; also of rigid parts."""
    document, nodes = rig.document, {rig.nodes[j]: j for j in joints}
    place, found = {node: joint for joint, node in enumerate(rig.nodes)}, []
    for node in document.json.get("nodes", []):
        if "mesh" not in node or "skin" not in node:
            continue
        skin = document.json["skins"][node["skin"]]
        try:
            inverse = document.values(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
            slot = next((s for s, n in enumerate(skin["joints"]) if n in nodes), None)
            if slot is None:
                continue
            space = rig.bind[place[skin["joints"][slot]]] @ inverse[slot]
            for primitive in document.json["meshes"][node["mesh"]]["primitives"]:
                attributes = primitive["attributes"]
                points, own, weights = (document.values(attributes[n]) for n in ("POSITION", "JOINTS_0", "WEIGHTS_0"))
                main = np.take_along_axis(own, weights.argmax(axis=1)[:, None], 1)[:, 0]
                mine = np.isin(main, [s for s, n in enumerate(skin["joints"]) if n in nodes])
                found.append(points[mine] @ space[:3, :3].T + space[:3, 3])
        except (GltfError, KeyError, IndexError, ValueError):
            continue
    found += _rigid_points(rig, joints)
    return np.concatenate(found) if found else np.zeros((0, 3))


def _rigid_points(rig: Rig, joints: set[int]) -> list[np.ndarray]:
    """Vertices of meshes that hang from joints without a skin."""
    document, found = rig.document, []
    worlds = document.node_worlds() if not rig.skinned.any() else None
    for joint in joints if worlds is not None else ():
        node = document.json["nodes"][rig.nodes[joint]]
        if "mesh" in node and worlds is not None:
            for primitive in document.json["meshes"][node["mesh"]]["primitives"]:
                try:
                    points = document.values(primitive["attributes"]["POSITION"])
                except GltfError:
                    continue
                found.append(points @ rig.bind[joint][:3, :3].T + rig.bind[joint][:3, 3])
    return found


def _skeleton(shape: _Straightened, rig: Rig, bones: dict[str, int], scale: float) -> tuple[Skeleton, dict[int, int]]:
    """The 22 joints in shown metres, and which joint of the rig takes whose orientation."""
    base = humanoid_skeleton()
    places = {bone: (at - shape.our_hips) * scale for bone, at in shape.positions.items()}
    places["hips"] = np.zeros(3)
    carriers = {joint: base.index(bone) for bone, joint in bones.items()}
    _fill_trunk(places, carriers, bones, base)
    for side, outwards in (("left", 1.0), ("right", -1.0)):
        if f"{side}Shoulder" not in places:
            places[f"{side}Shoulder"] = places[f"{side}UpperArm"] - [outwards * _STUB, 0, 0]
        if f"{side}Toes" not in places:
            foot = places[f"{side}Foot"]
            ankle = float(foot[1] + shape.our_hips[1] * scale)
            leg = float(np.linalg.norm(places[f"{side}UpperLeg"] - foot))
            # the humanoid's ball is 0.125 m ahead of an ankle 0.08 m high on legs of 0.82 m
            places[f"{side}Toes"] = foot + np.array([0, -0.7 * ankle, 0.125 / 0.82 * leg])
    offsets = np.zeros((base.joint_count, 3))
    for joint, bone in enumerate(base.joint_names):
        parent = base.parents[joint]
        offsets[joint] = places[bone] - (places[base.joint_names[parent]] if parent >= 0 else 0)
    offsets[0] = [0, shape.our_hips[1] * scale, 0]
    tips = _tips(shape, rig, bones, places, scale, base)
    return (
        Skeleton(
            joint_names=base.joint_names,
            parents=base.parents,
            rest_offsets=offsets.astype(np.float32),
            rest_rotations=base.rest_rotations,
            humanoid_bones=base.humanoid_bones,
            tips=tips,
            name=rig.name,
        ),
        carriers,
    )


def _fill_trunk(places: dict[str, np.ndarray], carriers: dict[int, int], bones: dict[str, int], base: Skeleton) -> None:
    """Places for trunk bones that the rig lacks: on the last one that it has, which takes their orientation."""
    up = np.array([0.0, _STUB, 0.0])
    last = "hips"
    for bone in ("spine", "chest", "upperChest"):
        if bone in bones:
            last = bone
            continue
        before = base.joint_names[base.parents[base.index(bone)]]
        places[bone] = places[before] + up
        if last != "hips":  # a rig without any spine bends nowhere: its hips keep their own orientation
            carriers[bones[last]] = base.index(bone)
    if "neck" not in bones:
        places["neck"] = places["head"] - up


def _tips(
    shape: _Straightened, rig: Rig, bones: dict[str, int], places: dict[str, np.ndarray], scale: float, base: Skeleton
) -> tuple[Tip, ...]:
    """End points of head, hands and toes: what the mesh reaches there, else as far as people's."""
    size = float(np.linalg.norm(places["leftUpperLeg"] - places["leftFoot"])) / 0.82  # against the humanoid's legs
    found = []
    for tip in base.tips:
        bone = base.joint_names[tip.parent]
        offset = np.array(tip.offset) * size
        if bone in bones:
            points = bound_points(rig, {bones[bone], *_all_below(rig, bones[bone])})
            if len(points) > 8:
                local = quat_rotate(np.asarray(shape.swings[bone]), points - shape.at[bones[bone]]) * scale
                axis = int(np.argmax(np.abs(tip.offset)))
                reach = float(np.percentile(local[:, axis] * np.sign(tip.offset[axis]), 98))
                limits = np.array([0.5, 1.6]) * abs(offset[axis])  # hats, hair and weapons are no part of the body
                offset[axis] = np.sign(tip.offset[axis]) * float(np.clip(reach, *limits))
        found.append(Tip(tip.name, tip.parent, (float(offset[0]), float(offset[1]), float(offset[2]))))
    return tuple(found)


def _all_below(rig: Rig, joint: int) -> list[int]:
    found = list(rig.children[joint])
    for item in found:
        found += rig.children[item]
    return found
