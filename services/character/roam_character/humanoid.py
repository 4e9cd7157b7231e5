"""Which joint of a foreign skeleton is which humanoid bone, by the names that common tools use.

Covered: VRM / Unity humanoid, Mixamo, CMU (DAZ/Poser figure and the 3ds Max variant), SMPL, Rigify-like `upper_arm.L`.
"""

import re

from roam_character.skeleton import Skeleton

# Lower-case names without side, separators or prefixes -> VRM bone (a leading "*" takes the side).
_CENTRE = {
    "hips": "hips",
    "hip": "hips",
    "pelvis": "hips",
    "root": "hips",
    "abdomen": "chest",
    "chest": "chest",
    "spine": "spine",
    "lowerback": "spine",
    "spine1": "chest",
    "spine2": "upperChest",
    "spine3": "upperChest",
    "upperchest": "upperChest",
    "neck": "neck",
    "neck1": "neck",
    "head": "head",
}
_SIDED = {
    "collar": "Shoulder",
    "shoulder": "Shoulder",
    "clavicle": "Shoulder",
    "shldr": "UpperArm",
    "arm": "UpperArm",
    "upperarm": "UpperArm",
    "forearm": "LowerArm",
    "lowerarm": "LowerArm",
    "elbow": "LowerArm",
    "hand": "Hand",
    "wrist": "Hand",
    "thigh": "UpperLeg",
    "upleg": "UpperLeg",
    "upperleg": "UpperLeg",
    "shin": "LowerLeg",
    "leg": "LowerLeg",
    "lowerleg": "LowerLeg",
    "calf": "LowerLeg",
    "knee": "LowerLeg",
    "foot": "Foot",
    "ankle": "Foot",
    "toe": "Toes",
    "toes": "Toes",
    "toebase": "Toes",
}
# Figures whose names mean other bones than elsewhere, recognised by one tell-tale joint.
_DAZ = {"abdomen": "chest", "chest": "upperChest"}
_SMPL = {"spine1": "spine", "spine2": "chest", "spine3": "upperChest", "leftcollar": "leftShoulder"}


def humanoid_bones_of(skeleton: Skeleton) -> dict[str, int]:
    """VRM bone -> joint index, for every bone that can be told from the names (first joint wins).

    A skeleton that states its humanoid bones is believed.
    """
    stated = {bone: i for i, bone in enumerate(skeleton.humanoid_bones) if bone}
    if stated:
        return stated
    lower = [name.lower() for name in skeleton.joint_names]
    special = _DAZ if "abdomen" in lower else _SMPL if "left_collar" in lower and "spine3" in lower else {}
    found: dict[str, int] = {}
    for joint, name in enumerate(skeleton.joint_names):
        bone = _bone(name, special)
        if bone and bone not in found:
            found[bone] = joint
    return found


def _bone(name: str, special: dict[str, str]) -> str | None:
    name = name.split(":")[-1]
    side, rest = _split_side(name)
    plain = re.sub(r"[^a-z0-9]", "", rest.lower())
    if side:
        # SMPL calls the upper arm "shoulder" and the clavicle "collar".
        if special is _SMPL and plain == "shoulder":
            return side + "UpperArm"
        return side + _SIDED[plain] if plain in _SIDED else None
    return special.get(plain) or _CENTRE.get(plain)


def _split_side(name: str) -> tuple[str, str]:
    patterns = (
        (r"^(?:left|l)[_.]?(?=[A-Z_.])|^left[_.]?", "left"),
        (r"^(?:right|r)[_.]?(?=[A-Z_.])|^right[_.]?", "right"),
    )
    for pattern, side in patterns:
        match = re.match(pattern, name) or re.match(pattern, name.replace("Left", "left").replace("Right", "right"))
        if match:
            return side, name[match.end() :]
    match = re.search(r"[_.](l|r|left|right)$", name, re.IGNORECASE)
    if match:
        return ("left" if match[1].lower().startswith("l") else "right"), name[: match.start()]
    return "", name
