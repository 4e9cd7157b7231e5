"""Skeletons as data: a joint tree in its rest pose, loaded from JSON.

The shipped ones: `humanoid` (VRM 1.0 bones from hips to toes, 22 joints, the default and the pivot of retargeting) and
`paper` (24 rotating joints, 3 + 3 x 24 = 75 degrees of freedom, as in the ROAM paper, section 3.1).
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

_FOLDER = Path(__file__).parent / "skeletons"


@dataclass(frozen=True)
class Tip:
    """An end point without rotation of its own: top of the head, finger tips, toe tips."""

    name: str
    parent: int
    offset: tuple[float, float, float]  # from the parent, in its frame [m]


@dataclass(frozen=True)
class Level:
    """Joints of one depth of the tree, so that kinematics needs one batched step per depth."""

    joints: tuple[int, ...]
    parent_slots: tuple[int, ...]  # place of each joint's parent within the previous level


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A joint hierarchy; in the rest pose all rotations are `rest_rotations` and the figure faces +Z.

    Raises ValueError when parents do not precede children, names repeat, or shapes disagree.
    """

    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    rest_offsets: np.ndarray  # [J, 3] from the parent [m]
    rest_rotations: np.ndarray  # [J, 4] xyzw, relative to the parent
    humanoid_bones: tuple[str, ...] = ()
    tips: tuple[Tip, ...] = ()
    name: str = ""
    _index: dict[str, int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = len(self.joint_names)
        if len(set(self.joint_names)) != count:
            raise ValueError("joint_names repeat; give every joint its own name")
        if len(self.parents) != count or self.rest_offsets.shape != (count, 3):
            raise ValueError(f"{count} joint names need {count} parents and rest offsets of shape ({count}, 3)")
        if self.parents[0] != -1 or any(not 0 <= p < i for i, p in enumerate(self.parents) if i):
            raise ValueError("joint 0 must be the root (parent -1) and every parent must precede its children")
        object.__setattr__(self, "_index", {name: i for i, name in enumerate(self.joint_names)})
        if not self.humanoid_bones:
            object.__setattr__(self, "humanoid_bones", ("",) * count)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Skeleton) and other.id == self.id

    def __hash__(self) -> int:
        return hash(self.id)

    @property
    def joint_count(self) -> int:
        """Number of rotating joints J."""
        return len(self.joint_names)

    @property
    def dof(self) -> int:
        """Degrees of freedom: root translation and three per joint."""
        return 3 + 3 * self.joint_count

    def index(self, name: str) -> int:
        """Joint index of a joint name or humanoid bone name; KeyError when there is none."""
        if name in self._index:
            return self._index[name]
        if name and name in self.humanoid_bones:
            return self.humanoid_bones.index(name)
        raise KeyError(f"no joint {name!r}; joints are {', '.join(self.joint_names)}")

    def indices(self, names: Sequence[str]) -> list[int]:
        """Joint indices of several names."""
        return [self.index(name) for name in names]

    @cached_property
    def id(self) -> str:
        """Content hash "sha256:…" of names, parents, rest offsets, rest rotations and humanoid bones."""
        digest = hashlib.sha256()
        digest.update(json.dumps([self.joint_names, self.parents, self.humanoid_bones]).encode())
        digest.update(np.ascontiguousarray(self.rest_offsets, "<f4").tobytes())
        digest.update(np.ascontiguousarray(self.rest_rotations, "<f4").tobytes())
        return f"sha256:{digest.hexdigest()}"

    @cached_property
    def levels(self) -> tuple[Level, ...]:
        """The joints by depth, root first."""
        levels = [Level((0,), (-1,))]
        while True:
            above = levels[-1].joints
            joints = [j for j, p in enumerate(self.parents) if p in above]
            if not joints:
                return tuple(levels)
            levels.append(Level(tuple(joints), tuple(above.index(self.parents[j]) for j in joints)))

    @cached_property
    def level_places(self) -> tuple[int, ...]:
        """For every joint its place when the levels are laid one after the other."""
        order = [j for level in self.levels for j in level.joints]
        return tuple(sorted(range(len(order)), key=order.__getitem__))

    @cached_property
    def upper_joints(self) -> tuple[int, ...]:
        """For every joint the one that its bone hangs on: its parent, the root for the root."""
        return (0, *self.parents[1:])

    @cached_property
    def ancestors(self) -> np.ndarray:
        """[J, J] 1 where the column's joint is the row's or above it."""
        above = np.eye(self.joint_count, dtype=np.float32)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                above[joint] += above[parent]
        return above

    @cached_property
    def bone_offsets(self) -> np.ndarray:
        """[J, 3] `rest_offsets` [m] without the root's, which no bone carries."""
        offsets = np.array(self.rest_offsets)
        offsets[0] = 0.0
        return offsets

    @cached_property
    def mirror(self) -> tuple[int, ...]:
        """For every joint its left-right partner (itself in the middle)."""
        return tuple(self._index.get(_mirror_name(name), i) for i, name in enumerate(self.joint_names))


_SIDES = (("left", "right"), ("Left", "Right"), ("l", "r"), ("L", "R"))


def _mirror_name(name: str) -> str:
    """The name with its side exchanged; a single letter is a side only before a capital: lThigh, but not lumbar."""
    for a, b in _SIDES:
        for here, there in ((a, b), (b, a)):
            rest = name[len(here) :]
            if name.startswith(here) and (len(here) > 1 or rest[:1].isupper()):
                return there + rest
    return name


def skeleton_from_dict(data: dict[str, Any]) -> Skeleton:
    """A skeleton from its JSON form (see skeletons/humanoid.json)."""
    joints = data["joints"]
    names = [joint["name"] for joint in joints]
    tips = [Tip(t["name"], names.index(t["parent"]), tuple(t["offset"])) for t in data.get("tips", [])]
    return Skeleton(
        joint_names=tuple(names),
        parents=tuple(names.index(j["parent"]) if j["parent"] else -1 for j in joints),
        rest_offsets=np.array([j["offset"] for j in joints], np.float32),
        rest_rotations=np.array([j.get("rotation", (0, 0, 0, 1)) for j in joints], np.float32),
        humanoid_bones=tuple(j.get("humanoid", "") for j in joints),
        tips=tuple(tips),
        name=data.get("name", ""),
    )


@cache
def load_skeleton(name_or_path: str) -> Skeleton:
    """A shipped skeleton by name (`humanoid`, `paper`) or any skeleton file by path."""
    path = _FOLDER / f"{name_or_path}.json"
    if not path.exists():
        path = Path(name_or_path)
    if not path.exists():
        known = ", ".join(sorted(p.stem for p in _FOLDER.glob("*.json")))
        raise FileNotFoundError(f"no skeleton {name_or_path!r}: give one of {known}, or the path of a skeleton file")
    return skeleton_from_dict(json.loads(path.read_text()))


def humanoid_skeleton() -> Skeleton:
    """The default: 22 VRM 1.0 humanoid bones, hips to toes, 1.69 m tall."""
    return load_skeleton("humanoid")
