"""Which joint of a character is which humanoid bone: by what the file declares, else by words, else by shape.

Words say which joints belong to an arm or a leg and how far out; the tree says the rest: the hips are where both legs
and the spine leave, the spine is the way from there to the joint that carries the arms, the neck what follows it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from roam_character.rigs.families import family_of
from roam_character.rigs.rig import HUMANOID_BONES, NEEDED_BONES, Rig, RigError
from roam_character.rigs.structure import limbs_by_shape
from roam_character.rigs.words import END, LOWER, SHOULDER, TIP, UPPER, Reading, readings

_LIMB_BONES = {
    "arm": {SHOULDER: "Shoulder", UPPER: "UpperArm", LOWER: "LowerArm", END: "Hand"},
    "leg": {UPPER: "UpperLeg", LOWER: "LowerLeg", END: "Foot", TIP: "Toes"},
}
_REMEDY = (
    "A humanoid needs hips, head, and for each side upper arm, forearm, hand, thigh, shin and foot as joints of their "
    'own. Say which is which in a map: --map FILE with {"hips": "joint name", "leftUpperLeg": …}.'
)
# How sure a bone is by what told it; measured on the rigs of `roam evaluate rigs`: all of the first three were right.
_SURE = {"given": 1.0, "declared": 1.0, "words": 0.95, "tree": 0.9, "shape": 0.6}


@dataclass(frozen=True)
class BoneMap:
    """Humanoid bones of a rig."""

    bones: dict[str, int]  # VRM bone -> joint; bones that the rig lacks are missing
    confidence: dict[str, float]  # of every bone in `bones`, 0 to 1
    family: str = ""  # whose naming it is, "" when unknown
    doubts: tuple[str, ...] = field(default=())  # what looked odd

    @property
    def overall(self) -> float:
        """The least confidence of the bones that a humanoid needs."""
        return min(self.confidence[bone] for bone in NEEDED_BONES)

    def names(self, rig: Rig) -> dict[str, str | None]:
        """The map as it stands in a map file."""
        return {bone: _stored(rig, self.bones[bone]) if bone in self.bones else None for bone in HUMANOID_BONES}


def _stored(rig: Rig, joint: int) -> str:
    name = rig.joint_names[joint]
    return name if rig.joint_names.count(name) == 1 else f"#{rig.nodes[joint]}"


def map_bones(rig: Rig, overrides: Mapping[str, str | None] | None = None) -> BoneMap:
    """The humanoid bones of a rig.

    `overrides` name joints (or null: there is none) for some or all bones; they win. Raises RigError with what is
    missing when the rig is no humanoid.
    """
    given = _given(rig, overrides or {})
    rig = _upright(rig)
    found, source = _automatic(rig)
    for bone, joint in given.items():
        found.pop(bone, None)
        taken = [b for b, j in found.items() if j == joint]
        for other in taken:  # a joint that is given to one bone is taken from another
            del found[other]
        if joint is not None:
            found[bone], source[bone] = joint, "given"
    missing = [bone for bone in NEEDED_BONES if bone not in found]
    if missing:
        raise RigError(f"{rig.name} is no humanoid that can be used: no joint for {', '.join(missing)}", remedy=_REMEDY)
    doubts, worth = _check(rig, found, strict=not given)
    confidence = {bone: _SURE[source[bone]] * worth.get(bone, 1.0) for bone in found}
    ordered = {bone: found[bone] for bone in HUMANOID_BONES if bone in found}
    return BoneMap(ordered, confidence, family_of(rig.joint_names, declared=bool(rig.declared)), doubts)


def read_map(path: str | Path) -> dict[str, str | None]:
    """A map file: JSON of {VRM bone: joint name, "#node index" or null}. Raises RigError."""
    path = Path(path)
    try:
        found = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError) as error:
        raise RigError(f"{path.name} is no map file: {error}", remedy=_REMEDY) from error
    if not isinstance(found, dict) or not all(v is None or isinstance(v, str) for v in found.values()):
        raise RigError(f"{path.name} is no map file: it must be {{bone: joint name or null}}", remedy=_REMEDY)
    unknown = sorted(set(found) - set(HUMANOID_BONES))
    if unknown:
        raise RigError(f"{path.name} names unknown bones {', '.join(unknown)}", remedy=f"Bones are {_BONE_LIST}.")
    return found


_BONE_LIST = ", ".join(HUMANOID_BONES)


def _given(rig: Rig, overrides: Mapping[str, str | None]) -> dict[str, int | None]:
    return {bone: None if name is None else rig.index(name) for bone, name in overrides.items()}


_TURNS = {
    "-y": np.diag([1.0, -1.0, -1.0]),
    "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "x": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "-x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}


def _upright(rig: Rig) -> Rig:
    """The rig standing along +Y, whatever axis is up in its file: only looked at, the file stays as it is."""
    read = readings(rig.joint_names)
    limbs = dict(rig.declared) or _limbs_by_words(rig, read)
    if not {"leftUpperArm", "rightUpperArm", "leftUpperLeg", "rightUpperLeg"} <= limbs.keys():
        return rig
    ends = [rig.bind[[limbs[f"left{b}"], limbs[f"right{b}"]], :3, 3].mean(axis=0) for b in ("UpperArm", "UpperLeg")]
    trunk = ends[0] - ends[1]
    if trunk[1] >= 0.5 * np.linalg.norm(trunk):
        return rig
    turn = np.eye(4)
    turn[:3, :3] = max(_TURNS.values(), key=lambda matrix: float((matrix @ trunk)[1]))
    return replace(rig, bind=turn @ rig.bind, rest=turn @ rig.rest)


def _automatic(rig: Rig) -> tuple[dict[str, int], dict[str, str]]:
    """Bones and what told each."""
    if all(bone in rig.declared for bone in NEEDED_BONES):
        return dict(rig.declared), dict.fromkeys(rig.declared, "declared")
    read = readings(rig.joint_names)
    limbs, source = _limbs_by_words(rig, read), "words"
    missing = [bone for bone in NEEDED_BONES[2:] if bone not in limbs]
    if missing:
        shaped = limbs_by_shape(rig, read)
        if shaped is None:
            return limbs, dict.fromkeys(limbs, source)
        named = limbs if len(missing) <= 4 and _agrees(limbs, shaped.bones) else {}
        limbs, source = {**shaped.bones, **named}, "shape"
    told = dict.fromkeys(limbs, source)
    trunk = _trunk(rig, read, limbs)
    told |= dict.fromkeys((bone for bone in trunk if bone not in told), "tree" if source == "words" else source)
    return {**limbs, **trunk}, told


def _agrees(named: dict[str, int], shaped: dict[str, int]) -> bool:
    """Whether the few bones that words told are where the shape has them too."""
    both = [bone for bone in named if bone in shaped]
    return sum(named[bone] == shaped[bone] for bone in both) >= 0.8 * len(both)


def _limbs_by_words(rig: Rig, read: list[Reading]) -> dict[str, int]:
    found: dict[str, int] = {}
    for side in ("left", "right"):
        for limb, names in _LIMB_BONES.items():
            joints = [i for i, r in enumerate(read) if r.side == side and r.limb == limb and not r.helper]
            for place, joint in _places(rig, read, joints).items():
                if place in names:
                    found[side + names[place]] = joint
    return found


def _places(rig: Rig, read: list[Reading], joints: list[int]) -> dict[int, int]:
    """Place along one limb -> joint: of several joints of a place the one nearest the trunk."""
    certain: dict[int, list[int]] = {}
    for joint in joints:
        if len(read[joint].places) == 1:
            certain.setdefault(read[joint].places[0], []).append(joint)
    for joint in joints:
        if len(read[joint].places) > 1:
            certain.setdefault(_settled(rig, read[joint].places, joint, certain), []).append(joint)
    # A joint whose words place it farther in than one of its own ancestors of the same limb is a helper below it.
    places = {place: min(group, key=lambda j: (_depth(rig, j), j)) for place, group in certain.items()}
    if LOWER not in places and len(certain.get(UPPER, [])) > 1:
        below = [j for j in certain[UPPER] if places[UPPER] in rig.ancestors(j)]
        if below:
            places[LOWER] = min(below, key=lambda j: (_depth(rig, j), j))
    return places


def _settled(rig: Rig, places: tuple[int, ...], joint: int, certain: dict[int, list[int]]) -> int:
    """The place of a joint whose word means two."""
    if places == (SHOULDER, UPPER):  # with a collar and no upper arm `shoulder` is the upper arm
        return SHOULDER if UPPER in certain else UPPER
    if places == (LOWER, UPPER):  # `leg` is the shin below a thigh and the thigh above a knee
        above = certain.get(UPPER, [])
        return LOWER if set(above) - {joint} else UPPER
    ankles = certain.get(END, [])  # below an ankle `foot` is the toes
    return TIP if any(a in rig.ancestors(joint) for a in ankles) else END


def _depth(rig: Rig, joint: int) -> int:
    return len(rig.ancestors(joint))


def _trunk(rig: Rig, read: list[Reading], limbs: dict[str, int]) -> dict[str, int]:
    """Hips, spine, chest, upper chest, neck, head from the tree between the limbs."""
    arms = [limbs.get(f"{side}Shoulder", limbs[f"{side}UpperArm"]) for side in ("left", "right")]
    legs = [limbs[f"{side}UpperLeg"] for side in ("left", "right")]
    head = _head(rig, read, limbs)
    carrier = _common(rig, [*arms, *([head] if head is not None else [])]) if head is not None else _common(rig, arms)
    if carrier is None:
        return {} if head is None else {"head": head}
    hips = _hips(rig, read, legs, carrier)
    found = {"hips": hips}
    way = rig.path(hips, carrier)[1:]
    while way and read[way[-1]].trunk == "neck":  # a Biped's collar bones hang from its neck
        carrier = rig.parents[way.pop()]
    found |= _spine(rig, read, way, legs)
    if head is not None:
        found["head"] = head
        above = [j for j in rig.path(carrier, head)[1:-1] if not read[j].helper]
        necks = [j for j in above if read[j].trunk == "neck"] or above
        if necks:
            found["neck"] = necks[0]
    return found


def _head(rig: Rig, read: list[Reading], limbs: dict[str, int]) -> int | None:
    named = [i for i, r in enumerate(read) if r.trunk == "head" and not r.helper]
    necks = [i for i, r in enumerate(read) if r.trunk == "neck"]
    # Rigify numbers its spine up to the head; elsewhere the head is what the necks end in.
    if named:
        return min(named, key=lambda j: (_depth(rig, j), j))
    if "head" in limbs:
        return limbs["head"]
    arms = [limbs[f"{side}UpperArm"] for side in ("left", "right")]
    carrier = _common(rig, arms)
    if carrier is None:
        return None
    tops = [j for j in range(rig.joint_count) if carrier in rig.ancestors(j) and not read[j].side]
    spines = [j for j in tops if not read[j].helper and (rig.weighted[j] or rig.children[j])]
    chain = [j for j in spines if read[j].trunk in ("spine", "neck", "")]
    if not chain:
        return None
    parent, steps = carrier, list[int]()
    while below := [j for j in chain if rig.parents[j] == parent]:
        parent = max(below, key=lambda j: (read[j].trunk != "", rig.bind[j, 1, 3]))
        if steps and not read[parent].trunk and read[steps[-1]].trunk:
            break
        steps.append(parent)
    return steps[-1] if len(steps) > bool(necks and steps and steps[-1] in necks) else None


def _common(rig: Rig, joints: list[int]) -> int | None:
    """The nearest joint above all of several ones."""
    lines = [rig.ancestors(joint) for joint in joints]
    return next((j for j in lines[0] if all(j in line for line in lines[1:])), None)


def _hips(rig: Rig, read: list[Reading], legs: list[int], carrier: int) -> int:
    """Where both legs and the spine leave the trunk."""
    lines = [[carrier, *rig.ancestors(carrier)], *(rig.ancestors(leg) for leg in legs)]
    top = next((j for j in lines[0] if all(j in line for line in lines[1:])), carrier)
    above = rig.parents[top]
    if read[top].trunk == "spine" and above >= 0 and read[above].trunk == "hips":
        return above  # a Biped's thighs hang from its lowest spine joint
    named = [j for j in lines[0] if read[j].trunk == "hips"]
    middle = rig.bind[legs, :3, 3].mean(axis=0)
    far = np.linalg.norm(rig.bind[top, :3, 3] - middle) > 0.5 * _leg_drop(rig, legs)
    if (far or not rig.skinned[top]) and rig.skinned.any():
        # No tree (Rigify's deforming bones): the named one, or the lowest joint of the trunk.
        inside = [j for j in lines[0] if rig.skinned[j]]
        return named[-1] if named else inside[-1] if inside else top
    return top


def _leg_drop(rig: Rig, legs: list[int]) -> float:
    return float(rig.bind[legs, 1, 3].mean() - rig.bind[:, 1, 3].min())


def _spine(rig: Rig, read: list[Reading], way: list[int], legs: list[int]) -> dict[str, int]:
    """Which of the joints from above the hips to the arms are spine, chest and upper chest."""
    low = float(rig.bind[legs, 1, 3].mean()) - 0.05 * _leg_drop(rig, legs)
    bones = [j for j in way if read[j].trunk != "hips" and not read[j].helper]
    if any(read[j].trunk == "spine" for j in bones):
        bones = [j for j in bones if read[j].trunk or rig.bind[j, 1, 3] >= low]
    if not bones:
        return {}
    if len(bones) < 3:
        return dict(zip(("spine", "chest"), bones, strict=False))
    return {"spine": bones[0], "chest": bones[len(bones) // 2], "upperChest": bones[-1]}


def _check(rig: Rig, bones: dict[str, int], *, strict: bool) -> tuple[tuple[str, ...], dict[str, float]]:
    """Doubts about a map and factors on the confidence of bones. Raises RigError for what stands on four legs or has
    two bones at one joint."""
    at = {bone: rig.bind[joint, :3, 3] for bone, joint in bones.items()}
    doubts, worth = [], dict[str, float]()
    if len(set(bones.values())) < len(bones):
        raise RigError(
            f"{rig.name}: one joint is named for two bones", remedy="Give every bone its own joint, or null."
        )
    legs, arms = (
        [(side + a, side + b) for side in ("left", "right") for a, b in pairs]
        for pairs in (
            (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot")),
            (("UpperArm", "LowerArm"), ("LowerArm", "Hand")),
        )
    )
    for (one, two), (three, four) in (*zip(legs[:2], legs[2:], strict=True), *zip(arms[:2], arms[2:], strict=True)):
        left, right = (float(np.linalg.norm(at[b] - at[a])) for a, b in ((one, two), (three, four)))
        if min(left, right) < 1e-6:
            raise RigError(f"{rig.name}: {one} and {two} are at one place", remedy=_REMEDY)
        if max(left, right) > 1.25 * min(left, right):
            doubts.append(f"{one} and {three} differ in length: {left:.2f} and {right:.2f} m")
            worth |= dict.fromkeys((one, two, three, four), 0.7)
    hips = (at["leftUpperLeg"] + at["rightUpperLeg"]) / 2
    trunk = (at["leftUpperArm"] + at["rightUpperArm"]) / 2 - hips
    legs_up = hips - (at["leftFoot"] + at["rightFoot"]) / 2
    lean = float(trunk @ legs_up / max(np.linalg.norm(trunk) * np.linalg.norm(legs_up), 1e-9))
    if strict and lean < 0.5:
        raise RigError(
            f"{rig.name} is no upright figure: its trunk leans {np.degrees(np.arccos(np.clip(lean, -1, 1))):.0f}° "
            "from the line of its legs, like an animal's",
            remedy="Export it standing (bind pose), or give --map FILE to insist.",
        )
    if lean < 0.9:
        doubts.append("its trunk leans in the bind pose")
    return tuple(doubts), worth
