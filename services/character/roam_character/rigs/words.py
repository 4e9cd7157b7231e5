"""What the name of a joint says: a side, and the part of the body.

Names of many tools are read by their words, not by whole names, so that prefixes, separators and numbers do not matter:
`mixamorig:LeftUpLeg`, `Bip01 L Thigh`, `CC_Base_L_Thigh`, `DEF-thigh.L`, `J_Bip_L_UpperLeg`, `lfemur`, `左足`.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

# Places along a limb from the trunk outwards. A word may mean two places: which one shows in its neighbours.
SHOULDER, UPPER, LOWER, END, TIP = range(5)
ARM_WORDS: dict[str, tuple[int, ...]] = {
    "clavicle": (SHOULDER,), "collar": (SHOULDER,), "scapula": (SHOULDER,), "shoulder": (SHOULDER, UPPER),
    "upperarm": (UPPER,), "uparm": (UPPER,), "armupper": (UPPER,), "humerus": (UPPER,), "shldr": (UPPER,),
    "bicep": (UPPER,), "arm": (UPPER,),
    "forearm": (LOWER,), "lowerarm": (LOWER,), "lowarm": (LOWER,), "armlower": (LOWER,), "elbow": (LOWER,),
    "radius": (LOWER,), "ulna": (LOWER,), "armfore": (LOWER,),
    "hand": (END,), "wrist": (END,), "palm": (END,),
}  # fmt: skip
LEG_WORDS: dict[str, tuple[int, ...]] = {
    "thigh": (UPPER,), "upleg": (UPPER,), "upperleg": (UPPER,), "legupper": (UPPER,), "femur": (UPPER,),
    "hip": (UPPER,), "leg": (LOWER, UPPER),
    "shin": (LOWER,), "calf": (LOWER,), "lowerleg": (LOWER,), "lowleg": (LOWER,), "leglower": (LOWER,),
    "tibia": (LOWER,), "knee": (LOWER,), "foreleg": (LOWER,),
    "ankle": (END,), "foot": (END, TIP), "feet": (END,),
    "toe": (TIP,), "toes": (TIP,), "ball": (TIP,), "toebase": (TIP,),
}  # fmt: skip
TRUNK_WORDS = {
    "hips": "hips", "hip": "hips", "pelvis": "hips",
    "spine": "spine", "chest": "spine", "torso": "spine", "thorax": "spine", "abdomen": "spine", "waist": "spine",
    "lowerback": "spine", "upperback": "spine", "upperchest": "spine", "upperbody": "spine", "stomach": "spine",
    "tummy": "spine", "ribcage": "spine", "ribs": "spine", "back": "spine", "lumbar": "spine", "belly": "spine",
    "neck": "neck", "lowerneck": "neck", "upperneck": "neck", "necklower": "neck", "neckupper": "neck",
    "head": "head", "skull": "head",
}  # fmt: skip
# Japanese names of MMD figures, as whole names without their side.
_JAPANESE_LIMBS: dict[str, tuple[str, int]] = {
    "肩": ("arm", SHOULDER), "腕": ("arm", UPPER), "ひじ": ("arm", LOWER), "手首": ("arm", END),
    "足": ("leg", UPPER), "ひざ": ("leg", LOWER), "足首": ("leg", END), "つま先": ("leg", TIP),
}  # fmt: skip
_JAPANESE_TRUNK = {"上半身": "spine", "上半身2": "spine", "首": "neck", "頭": "head"}
# A joint with one of these words is a helper, a finger, a part of the face or a thing, never one of the 22 bones.
_NOT_BONES = """
    twist roll ik fk pole target ctrl control ctl handle helper end leaf nub site tip effector locator socket
    slot attach weapon sword gun shield prop props thumb index middle ring pinky pinkie little finger fingers
    fingerbase metacarpal carpal eye eyes eyelid brow eyebrow jaw teeth tooth tongue ear ears lip lips nose
    cheek mouth face hair bang bangs ponytail ribbon skirt cape cloak tail wing breast boob bust pec pectoral
    glute butt buttock muscle corrective adj adjust bulge share jiggle phys dynamic mch org wgt vis tweak parent
    null dummy trans footsteps floor ground camera light heel metatarsal metatarsals bag backpack hat helmet
    glasses belt tie collarbone_end pt armor armour accessory bend_helper space offset gizmo drv stretch
    hipjoint front hind
"""
NOT_BONES = frozenset(_NOT_BONES.split())
_SIDES = {"left": "left", "right": "right", "l": "left", "r": "right", "lft": "left", "rgt": "right", "lf": "left",
          "rt": "right"}  # fmt: skip
_SAYING = frozenset({*_SIDES, *ARM_WORDS, *LEG_WORDS, *TRUNK_WORDS})
_GLUED = tuple(sorted({*ARM_WORDS, *LEG_WORDS, "fingers", "thumb", "hipjoint", "bigtoe"}, key=len, reverse=True))


@dataclass(frozen=True)
class Reading:
    """What a name says."""

    side: str = ""  # left, right or ""
    limb: str = ""  # arm, leg or ""
    places: tuple[int, ...] = ()  # along the limb
    trunk: str = ""  # hips, spine, neck, head or ""
    helper: bool = False  # one of NOT_BONES
    number: int = 0  # at its end


def readings(names: Sequence[str]) -> list[Reading]:
    """What every name of a skeleton says. Words that most names share (mixamorig, Armature, bip01) say nothing."""
    split = [words_of(name) for name in names]
    counts = Counter(word for words in split for word in set(words))
    common = {w for w, n in counts.items() if n > 0.6 * len(names) and n > 4 and w not in _SAYING}
    return [_reading(name, [w for w in words if w not in common]) for name, words in zip(names, split, strict=True)]


def words_of(name: str) -> list[str]:
    """The words of a name in lower case: split at separators, capitals and digits; without a namespace."""
    name = re.split(r"[:|/]", name)[-1]
    name = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    name = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1 \2", name)
    name = re.sub(r"(\d+)", r" \1 ", name)
    return [word for word in re.split(r"[\s_.\-()\[\]]+", name.lower()) if word]


def _reading(name: str, words: list[str]) -> Reading:
    japanese = _japanese(name)
    if japanese is not None:
        return japanese
    numbers = [int(word) for word in words if word.isdigit()]
    words = [word for word in words if not word.isdigit()]
    side, words = _take_side(words)
    if len(words) == 1:
        side, words = _unglue(words[0], side)
    joined = {*words, *("".join(words[i : i + 2]) for i in range(len(words) - 1)), "".join(words)}
    number = numbers[-1] if numbers else 0
    neck = "neck" in joined and not {"end", "nub", "ik"} & joined
    if joined & NOT_BONES and not neck:
        return Reading(side=side, helper=True, number=number)
    if side:
        for limb, table in (("arm", ARM_WORDS), ("leg", LEG_WORDS)):
            # The longest word decides: `LeftForeArm` is no arm, `LeftToeBase` no base.
            found = sorted((word for word in joined if word in table), key=len, reverse=True)
            if found and not (limb == "arm" and any(w in LEG_WORDS and w != "hip" for w in joined)):
                return Reading(side=side, limb=limb, places=table[found[0]], number=number)
        return Reading(side=side, number=number)
    found = sorted((word for word in joined if word in TRUNK_WORDS), key=len, reverse=True)
    return Reading(trunk=TRUNK_WORDS[found[0]] if found else "", number=number)


def _take_side(words: list[str]) -> tuple[str, list[str]]:
    """The side among the words and the rest. A single letter counts at either end or before the last word."""
    for index, word in enumerate(words):
        if word in _SIDES and (len(word) > 1 or len(words) > 1):
            return _SIDES[word], words[:index] + words[index + 1 :]
    for index, word in enumerate(words):
        for full in ("left", "right"):
            if word.startswith(full) and len(word) > len(full):
                return full, [*words[:index], word[len(full) :], *words[index + 1 :]]
            if word.endswith(full) and len(word) > len(full):
                return full, [*words[:index], word[: -len(full)], *words[index + 1 :]]
    return "", words


def _unglue(word: str, side: str) -> tuple[str, list[str]]:
    """Acclaim's `lfemur`, `rhumerus`: a side letter glued to a word that is known."""
    if not side and word[:1] in "lr" and word[1:] in _GLUED:
        return _SIDES[word[0]], [word[1:]]
    return side, [word]


def _japanese(name: str) -> Reading | None:
    side = {"左": "left", "右": "right"}.get(name[:1], "")
    if side and name[1:] in _JAPANESE_LIMBS:
        limb, place = _JAPANESE_LIMBS[name[1:]]
        return Reading(side=side, limb=limb, places=(place,))
    return Reading(trunk=_JAPANESE_TRUNK[name]) if name in _JAPANESE_TRUNK else None
