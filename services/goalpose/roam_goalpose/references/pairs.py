"""Reference pose-object pairs: what the optimisation adapts (paper section 3.1). Files: examples/references/."""

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from roam_character.pose import Pose
from roam_character.skeleton import load_skeleton

from roam_goalpose.objects import Shape, format_of

ACTIONS = ("sit", "lie")


@dataclass(frozen=True, eq=False)
class ShapeFile:
    """An object that is read when it is first looked at, a tenth of a second after."""

    path: Path

    @cached_property
    def shape(self) -> Shape:
        """What the file holds. Raises ObjectError when it is no object."""
        from roam_goalpose.objects import load_shape

        return load_shape(self.path.read_bytes(), format_of(self.path.name))

    @cached_property
    def digest(self) -> str:
        """Of the file's bytes."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    def __getstate__(self) -> dict[str, Any]:
        """The path alone: another process reads the file itself, if it needs it."""
        return {"path": self.path}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)


@dataclass(frozen=True, eq=False)
class ReferencePair:
    """A pose in the space of the object that it was made for."""

    id: str
    title: str
    action: str  # "sit" or "lie"
    categories: tuple[str, ...]  # kinds of furniture that it is typical for
    pose: Pose
    source: Shape | ShapeFile  # the object, or where it comes from

    @property
    def shape(self) -> Shape:
        """The object."""
        return self.source.shape if isinstance(self.source, ShapeFile) else self.source

    @property
    def mark(self) -> str:
        """What object and pose are known by in a file of another process: a hash of both."""
        content = self.source.digest if isinstance(self.source, ShapeFile) else self.source.name
        return _digest(self.pose, [self.id, self.action, self.pose.skeleton.id, content])


def own_pair(shape: Shape, pose: Pose, *, action: str, title: str) -> ReferencePair:
    """A pair of the caller's own; its id "sha256:…" is a hash of object, pose and action."""
    digest = _digest(pose, [shape.name, pose.skeleton.id, action])
    return ReferencePair(f"sha256:{digest}", title, action, (), pose, shape)


def _digest(pose: Pose, said: list[str]) -> str:
    digest = hashlib.sha256(json.dumps(said).encode())
    digest.update(np.ascontiguousarray(pose.root_position, "<f4").tobytes())
    digest.update(np.ascontiguousarray(pose.rotations, "<f4").tobytes())
    return digest.hexdigest()


def distance_to_object(pair: ReferencePair) -> float:
    """From the hips joint to the object's surface [m]; 0 inside."""
    return max(0.0, float(pair.shape.distance.sample(pair.pose.root_position)))


def load_reference(path: Path) -> ReferencePair:
    """Reads NAME.json; the object file that it names, in the same folder, is read when it is looked at.

    Raises ValueError when the record is incomplete or its action unknown, FileNotFoundError when there is no object.
    """
    record = json.loads(path.read_text())
    missing = {"id", "title", "action", "object", "skeleton", "root_position", "rotations"} - record.keys()
    if missing:
        raise ValueError(f"{path.name} lacks {', '.join(sorted(missing))}; see examples/references/README.md")
    if record["action"] not in ACTIONS:
        raise ValueError(f"{path.name}: action is {record['action']!r}; it must be one of {', '.join(ACTIONS)}")
    skeleton = load_skeleton(record["skeleton"])
    rotations = np.array([record["rotations"][name] for name in skeleton.joint_names], np.float32)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    file = path.parent / record["object"]
    if not file.is_file():
        raise FileNotFoundError(f"{path.name} names the object {record['object']}, which is not there")
    return ReferencePair(
        id=record["id"],
        title=record["title"],
        action=record["action"],
        categories=tuple(record.get("categories", ())),
        pose=Pose(skeleton, np.array(record["root_position"], np.float32), rotations),
        source=ShapeFile(file),
    )


def load_references(folder: Path) -> dict[str, ReferencePair]:
    """All pairs of a folder by id, in the order of their file names. Raises FileNotFoundError when there are none."""
    pairs = [load_reference(path) for path in sorted(folder.glob("*.json"))]
    if not pairs:
        raise FileNotFoundError(f"no reference pairs (*.json) in {folder}; make them with examples/references/build.py")
    return {pair.id: pair for pair in pairs}
