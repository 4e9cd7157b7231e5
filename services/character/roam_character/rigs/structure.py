"""The limbs of a skeleton from its tree and its shape alone, for joints whose names say nothing.

Two legs are chains of like length that leave one joint, reach the lowest places and lie side by side; two arms leave
the trunk above and reach farthest to the sides; the head is what goes on upwards.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from roam_character.rigs.rig import Rig
from roam_character.rigs.words import Reading

_ALIKE = 1.3  # ratio of lengths that still makes a pair: real rigs differ by up to 1.09
_FOOT = 0.22  # an ankle's height as a part of the leg: people's is 0.08, chibi figures' 0.2


@dataclass(frozen=True)
class Limbs:
    """Joints by VRM name; what could not be found is missing."""

    bones: dict[str, int]
    hips: int
    carrier: int  # joint that the arms hang from


def limbs_by_shape(rig: Rig, read: list[Reading]) -> Limbs | None:
    """The 22 bones by shape; None when the tree holds no two legs, two arms and a head."""
    at = rig.bind[:, :3, 3]
    usable = _usable(rig, read)
    size = float(np.ptp(at[usable], axis=0).max()) if usable.sum() > 4 else 0.0
    if size <= 0:
        return None
    legs = _pair(rig, at, usable, range(rig.joint_count), down=True, size=size)
    if legs is None:
        return None
    hips, left, right = legs
    across = at[left[-1]] - at[right[-1]]
    across = across * [1, 0, 1] / max(float(np.linalg.norm(across * [1, 0, 1])), 1e-9)
    arms = _pair(rig, at, usable, _trunk(rig, hips, (left, right)), down=False, size=size, across=across)
    if arms is None:
        return None
    carrier, one, other = arms
    head = _head_path(rig, at, usable, carrier, (one, other))
    sides = _sides(rig, at, left, right, one, other)
    bones = {"hips": hips, **_leg_bones(at, sides[0], "left"), **_leg_bones(at, sides[1], "right")}
    bones |= {**_arm_bones(rig, at, sides[2], "left"), **_arm_bones(rig, at, sides[3], "right")}
    bones = _loose_feet(rig, at, bones, size)
    bones = {b: _farthest(rig, at, bones, b) for b in bones if rig.weighted[bones[b]] or not b.endswith("Toes")}
    head = [j for j in head if rig.weighted[j]]
    if head:
        bones["head"] = head[-1] if len(head) < 3 else head[1]
        if len(head) > 1:
            bones["neck"] = head[0]
    return Limbs(bones, hips, carrier)


def _farthest(rig: Rig, at: np.ndarray, bones: dict[str, int], bone: str) -> int:
    """Of several joints below a foot (toes, a heel) the toes are the farthest; every other bone is what it is."""
    if not bone.endswith("Toes"):
        return bones[bone]
    foot = bones[bone.replace("Toes", "Foot")]
    ends = [j for j in rig.children[foot] if rig.weighted[j]]
    return max(ends, key=lambda j: float(np.linalg.norm((at[j] - at[foot]) * [1, 0, 1])), default=bones[bone])


def _loose_feet(rig: Rig, at: np.ndarray, bones: dict[str, int], size: float) -> dict[str, int]:
    """Feet that hang from the root instead of the shins (baked inverse kinematics) are where the shins end."""
    found = dict(bones)
    for side in ("left", "right"):
        foot = bones[f"{side}Foot"]
        if rig.weighted[foot]:
            continue
        loose = [j for j in range(rig.joint_count) if rig.weighted[j] and j not in bones.values()]
        near = min(loose, key=lambda j: float(np.linalg.norm(at[j] - at[foot])), default=foot)
        if np.linalg.norm(at[near] - at[foot]) < 0.08 * size:
            found[f"{side}Foot"] = near
    return found


def _usable(rig: Rig, read: list[Reading]) -> np.ndarray:
    """Joints that may be bones: no helpers by name, and no joints without weight at the ends of chains."""
    keep = np.array([not item.helper for item in read])
    nodes = rig.document.json["nodes"]
    for joint in range(rig.joint_count - 1, -1, -1):
        above = rig.parents[joint]
        below = any(keep[c] for c in rig.children[joint])
        # An end without weight marks where the bone above it ends; a part of a mesh is no bone.
        end = rig.weighted[joint] or (above >= 0 and rig.weighted[above] and len(rig.children[above]) == 1)
        mesh = "mesh" in nodes[rig.nodes[joint]] and not below
        keep[joint] &= bool((below or end) and not mesh)
    return keep


def _chains(rig: Rig, usable: np.ndarray, top: int) -> list[list[int]]:
    """All ways from `top` to the ends below it."""
    below = [c for c in rig.children[top] if usable[c]]
    if not below:
        return [[top]]
    return [[top, *chain] for c in below for chain in _chains(rig, usable, c)]


def _length(at: np.ndarray, chain: list[int]) -> float:
    return float(np.linalg.norm(np.diff(at[chain], axis=0), axis=-1).sum())


def _pair(
    rig: Rig,
    at: np.ndarray,
    usable: np.ndarray,
    tops: "range | list[int]",
    *,
    down: bool,
    size: float,
    across: np.ndarray | None = None,
) -> tuple[int, list[int], list[int]] | None:
    """The joint from which the two best matching chains leave, and the chains."""
    best: tuple[float, int, list[int], list[int]] | None = None
    floor = float(at[usable, 1].min())
    for top in tops:
        ways = []
        for child in rig.children[top]:
            if usable[child]:
                chains = _chains(rig, usable, child)
                if down:
                    ways.append(min(chains, key=lambda c: at[c[-1], 1]))
                else:
                    assert across is not None
                    ways.append(max(chains, key=lambda c: abs(float((at[c[-1]] - at[top]) @ across))))
        for one, other in combinations(ways, 2):
            score = _match(at, top, one, other, down=down, size=size, floor=floor, across=across)
            if score is not None and (best is None or score > best[0]):
                best = score, top, one, other
    return None if best is None else best[1:]


def _match(
    at: np.ndarray, top: int, one: list[int], other: list[int], *, down: bool, size: float, floor: float,
    across: np.ndarray | None,
) -> float | None:  # fmt: skip
    """How well two chains make a pair of limbs; None when they do not."""
    if min(len(one), len(other)) < 3:
        return None
    lengths = [_length(at, chain) for chain in (one, other)]
    if min(lengths) < 0.15 * size or max(lengths) > _ALIKE * min(lengths):
        return None
    gap = at[one[-1]] - at[other[-1]]
    if down:
        ends = [float(at[chain[-1], 1]) - floor for chain in (one, other)]
        flat = float(np.linalg.norm(gap * [1, 0, 1]))
        if max(ends) > 0.15 * size or flat < 0.02 * size or float(at[top, 1]) - floor < 0.25 * size:
            return None
        return -max(ends) / size + min(lengths) / size
    assert across is not None
    reach = [float((at[chain[-1]] - at[top]) @ across) for chain in (one, other)]
    if reach[0] * reach[1] >= 0 or min(map(abs, reach)) < 0.08 * size:
        return None
    return min(map(abs, reach)) / size


def _trunk(rig: Rig, hips: int, legs: tuple[list[int], list[int]]) -> list[int]:
    """The hips and everything below them that is no leg."""
    taken = {joint for leg in legs for joint in leg}
    found, stack = [], [hips]
    while stack:
        joint = stack.pop()
        found.append(joint)
        stack += [c for c in rig.children[joint] if c not in taken]
    return found


def _head_path(
    rig: Rig, at: np.ndarray, usable: np.ndarray, carrier: int, arms: tuple[list[int], list[int]]
) -> list[int]:
    """Joints above the arms, upwards: as far as they follow one another without branching."""
    ways = [c for c in rig.children[carrier] if usable[c] and c not in (arms[0][0], arms[1][0])]
    if not ways:
        return []
    chain = [max(ways, key=lambda c: max(float(at[w[-1], 1]) for w in _chains(rig, usable, c)))]
    while len(below := [c for c in rig.children[chain[-1]] if usable[c]]) == 1 and len(chain) < 4:
        chain.append(below[0])
    return chain


def _below(rig: Rig, joint: int) -> list[int]:
    found = list(rig.children[joint])
    for item in found:
        found += rig.children[item]
    return found


def _sides(
    rig: Rig, at: np.ndarray, left: list[int], right: list[int], one: list[int], other: list[int]
) -> tuple[list[int], list[int], list[int], list[int]]:
    """Legs and arms, left ones first: the feet tell where it faces, their left is +X when it faces +Z."""
    forward = np.zeros(3)
    for leg in (left, right):
        foot = _leg_bones(at, leg, "left")["leftFoot"]
        ends = [(at[j] - at[foot]) * [1, 0, 1] for j in _below(rig, foot)]
        forward += max(ends, key=lambda v: float(np.linalg.norm(v)), default=np.zeros(3))
    across = at[left[0]] - at[right[0]]
    # up x forward points to the left; without feet that point anywhere it is taken to face +Z
    left_is = np.cross([0.0, 1.0, 0.0], forward) if np.linalg.norm(forward) > 1e-6 else np.array([1.0, 0.0, 0.0])
    if left_is @ across < 0:
        left, right = right, left
        across = -across
    if (at[one[-1]] - at[other[-1]]) @ across < 0:
        one, other = other, one
    return left, right, one, other


def _leg_bones(at: np.ndarray, chain: list[int], side: str) -> dict[str, int]:
    """Thigh, shin, foot and toes among the joints of a leg."""
    low, high = float(at[chain, 1].min()), float(at[chain[0], 1])
    steps = np.diff(at[chain], axis=0)
    flat = np.linalg.norm(steps[:, ::2], axis=-1) > 0.7 * np.linalg.norm(steps, axis=-1)  # 45 degrees
    height = (at[chain, 1] - low) / max(high - low, 1e-9)
    ends = [i for i in range(2, len(chain)) if height[i] < _FOOT or (height[i] < 0.4 and i < len(flat) and flat[i])]
    foot = ends[0] if ends else len(chain) - 1
    upper, lower = _two_longest(at, chain[: foot + 1])
    found = {"UpperLeg": chain[upper], "LowerLeg": chain[lower], "Foot": chain[foot]}
    if foot + 1 < len(chain):
        found["Toes"] = chain[foot + 1]
    return {side + bone: joint for bone, joint in found.items()}


def _arm_bones(rig: Rig, at: np.ndarray, chain: list[int], side: str) -> dict[str, int]:
    """Shoulder, upper arm, forearm and hand among the joints of an arm."""
    fork = next((i for i, j in enumerate(chain) if len(rig.children[j]) >= 3 and i >= 2), None)
    steps = np.linalg.norm(np.diff(at[chain], axis=0), axis=-1)
    if fork is None:  # no fingers: upper arm and forearm are the two neighbours that are both long
        both = [min(steps[i - 2], steps[i - 1]) for i in range(2, len(chain))]
        fork = max(i for i, length in enumerate(both, start=2) if length > 0.6 * max(both))
    upper, lower = _two_longest(at, chain[: fork + 1])
    found = {"UpperArm": chain[upper], "LowerArm": chain[lower], "Hand": chain[fork]}
    if upper > 0:
        found["Shoulder"] = chain[upper - 1]
    return {side + bone: joint for bone, joint in found.items()}


def _two_longest(at: np.ndarray, chain: list[int]) -> tuple[int, int]:
    """Places of the upper and the lower bone in a chain that ends with the limb's end: both as long as can be."""
    last = len(chain) - 1
    pairs = [(i, j) for i in range(last - 1) for j in range(i + 1, last)]

    def shorter(pair: tuple[int, int]) -> float:
        i, j = pair
        bones = np.linalg.norm(at[chain[j]] - at[chain[i]]), np.linalg.norm(at[chain[last]] - at[chain[j]])
        return float(min(bones))

    best = max(map(shorter, pairs))
    # Of equally good ones the one that begins farthest out: what is before it is a shoulder or a pelvis.
    return max((pair for pair in pairs if shorter(pair) > 0.7 * best), key=lambda pair: (pair[0], shorter(pair)))
