"""Names of the families of rigs that are known, told from a few tell-tale joints. Only for what is reported: the bones
themselves are told from words (words.py) and from the shape of the tree (structure.py).
"""

import re
from collections.abc import Sequence

# Family -> patterns that must all be found among the names (lower case).
FAMILIES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Mixamo", (r"^mixamorig\d*[:_]?hips$",)),
    ("VRoid", (r"^j_bip_c_hips$",)),
    ("Character Creator", (r"^cc_base_hip$",)),
    ("Valve Biped", (r"^valvebiped",)),
    ("3ds Max Biped", (r"^bip(0|00)?1?[ _]?pelvis$", r"^bip.*[ _]l[ _]thigh$")),
    ("Rigify (deform bones)", (r"^def-spine",)),
    ("Rigify metarig", (r"^spine\.001$", r"^thigh\.l$")),
    ("Unreal", (r"^pelvis$", r"^spine_01$", r"^thigh[_.]l$")),
    ("MakeHuman", (r"^spine0[1-5]$", r"^upperleg01\.l$")),
    ("SMPL-X", (r"^left_hip$", r"^left_collar$", r"^jaw$")),
    ("SMPL", (r"^(left_hip|l_hip)$", r"^(left_collar|l_collar)$")),
    ("Acclaim (CMU, HDM05)", (r"^lfemur$", r"^lhumerus$")),
    ("CMU BVH", (r"^lhipjoint$", r"^lowerback$")),
    ("Xsens", (r"(^|:)chest4$", r"(^|:)leftcollar$")),
    ("Xsens MVN", (r"^l5$", r"^t12$")),
    ("DAZ", (r"^lthighbend$", r"^abdomenlower$")),
    ("Rokoko", (r"^leftthigh$", r"^leftshin$", r"^hips$")),
    ("MikuMikuDance", ("^上半身$", "^左足$")),
    ("KayKit", (r"^upperleg\.l$", r"^handslot\.l$")),
    ("Quaternius", (r"^abdomen$", r"^upperleg\.l$")),
    ("Unity humanoid", (r"^leftupleg$|^leftupperleg$", r"^upperchest$|^chest$|^spine$")),
)


def family_of(names: Sequence[str], *, declared: bool = False) -> str:
    """The family of a skeleton by its joint names; "" when none is known."""
    lower = [name.lower() for name in names]
    for family, patterns in FAMILIES:
        if all(any(re.search(pattern, name) for name in lower) for pattern in patterns):
            return family
    return "VRM" if declared else ""
