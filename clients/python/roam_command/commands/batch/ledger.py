"""What a batch has done: poses in a folder, and a line of JSON for every object."""

import json
import os
from collections import Counter
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

from roam.v1 import goal_pose_pb2
from roam_client import GoalPose, Object, RoamError
from roam_client.types.skeleton import Skeleton

from roam_command.character import Character
from roam_command.commands.batch.work import Order, Outcome, digest_of
from roam_command.commands.pose import goal_pose_figures
from roam_command.exports import write_pose

LEDGER = "batch.jsonl"


class Ending(StrEnum):
    """Kind of file for a pose."""

    NPZ = "npz"
    JSON = "json"
    GLB = "glb"
    BVH = "bvh"
    VRMA = "vrma"
    USDZ = "usdz"
    FBX = "fbx"
    CSV = "csv"


class Ledger:
    """What was done, in OUT/batch.jsonl: the newest line of a file counts."""

    def __init__(
        self,
        output: Path,
        folder: Path,
        order: Order,
        ending: Ending,
        sources: Sequence[Path],
        character: Character | None = None,
    ) -> None:
        output.mkdir(parents=True, exist_ok=True)
        self._character = character
        self._alike = Counter(source.with_suffix("") for source in sources)
        self._folder = folder
        self._output = output
        self._ending = ending
        self._order = order.record()
        self._path = output / LEDGER
        self._records: dict[str, dict[str, Any]] = {}
        text = self._path.read_text() if self._path.exists() else ""
        for line in text.splitlines():
            self._read(line)
        if text and not text.endswith("\n"):  # a killed run left half a line
            self._append("\n")

    def _read(self, text: str) -> None:
        try:
            record = json.loads(text)
            self._records[record["file"]] = record
        except (ValueError, KeyError, TypeError):  # half a line
            return

    def target(self, source: Path) -> Path:
        """Where the pose of a file goes: sofa.glb gets sofa.pose.npz, and sofa.glb.pose.npz beside a sofa.obj."""
        alone = self._alike[source.with_suffix("")] < 2
        name = source.relative_to(self._folder)
        return self._output / f"{(name.with_suffix('') if alone else name).as_posix()}.pose.{self._ending}"

    def has(self, source: Path) -> bool:
        """Whether the same content was done with the same options, and the pose in its place is the one made then."""
        record = self._records.get(self._name(source), {})
        return (
            record.get("status") == "done"
            and record.get("order") == self._order
            and record.get("content") == _digest(source)
            and record.get("pose") == _digest(self.target(source))
        )

    def add(self, source: Path, outcome: Outcome, skeleton: Skeleton) -> dict[str, Any]:
        """Saves what came of one object and appends its line at once: whatever happens next, it is not forgotten."""
        figures = self._saved(source, outcome, skeleton)
        content = outcome.content or _digest(source)
        record = {"file": self._name(source), "content": content, "order": self._order, **figures}
        self._records[record["file"]] = record
        self._append(json.dumps(record, allow_nan=False) + "\n")
        return record

    def _append(self, text: str) -> None:
        try:
            with self._path.open("a") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise OSError(error.errno, f"cannot write {self._path}: {error.strerror}") from error

    def _saved(self, source: Path, outcome: Outcome, skeleton: Skeleton) -> dict[str, Any]:
        if not outcome.done:
            return {"status": "failed", "reason": outcome.reason, "message": outcome.message}
        place = Object.from_message(goal_pose_pb2.Object.FromString(outcome.object))
        message = goal_pose_pb2.GoalPose.FromString(outcome.goal_pose)
        goal = GoalPose.from_message(message, skeleton=skeleton, object_to_world=place.object_to_world)
        target = self.target(source)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            write_pose(target, goal, source=source, object=place, character=self._character)
        except (OSError, ValueError, RoamError) as error:
            said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            return {"status": "failed", "reason": "NOT_SAVED", "message": said}
        made = {"output": str(target), "pose": _digest(target)}
        return {"status": "done", **made, "seconds": outcome.seconds, **goal_pose_figures(goal)}

    def _name(self, source: Path) -> str:
        return source.relative_to(self._folder).as_posix()


def _digest(path: Path) -> str | None:
    """What a file is known by; None when it cannot be read."""
    try:
        return digest_of(path.read_bytes())
    except OSError:
        return None
