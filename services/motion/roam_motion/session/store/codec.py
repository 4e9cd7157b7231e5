"""Records as bytes and back, exactly: JSON, arrays and bytes in base64. For stores outside this process.

Furniture is only named, by its digest: the stores keep each volume once.
"""

from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import orjson
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton
from roam_character.volume import Volume

from roam_motion.control.intent import Goal, Idle, Intent, Steer
from roam_motion.control.paths import Outline
from roam_motion.session.records import ControlChange, ControlEntry, Event, EventKind, SessionRecord, Snapshot

Volumes = Mapping[str, Volume]  # by digest


class RecordCodec:
    """Reads and writes the records of sessions that all animate one skeleton."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton

    def encode(self, value: SessionRecord | Snapshot | ControlEntry) -> bytes:
        """A record as JSON."""
        fields: dict[str, Any] = dict(vars(value))
        if "change" in fields:
            fields["change"] = _change_fields(fields["change"])
        if isinstance(value, Snapshot):
            fields["state"] = b64encode(value.state).decode()
            fields["volume"] = value.volume and value.volume.digest
            fields["reached"] = value.reached and asdict(value.reached) | {"kind": value.reached.kind.value}
        return orjson.dumps(fields)

    def record(self, data: bytes) -> SessionRecord:
        """The terms of a session that `encode` wrote."""
        return SessionRecord(**orjson.loads(data))

    def control(self, data: bytes, volumes: Volumes) -> ControlEntry:
        """The control that `encode` wrote; `volumes` are those that it may name."""
        fields: dict[str, Any] = orjson.loads(data)
        change = self._change(fields["change"], volumes)
        return ControlEntry(**fields | {"change": change, "earlier": tuple(fields["earlier"])})

    def snapshot(self, data: bytes, volumes: Volumes) -> Snapshot:
        """The snapshot that `encode` wrote; `volumes` are those that it may name."""
        fields: dict[str, Any] = orjson.loads(data)
        reached = fields["reached"]
        return Snapshot(
            **fields
            | {
                "state": b64decode(fields["state"]),
                "volume": _named(fields["volume"], volumes),
                "change": self._change(fields["change"], volumes),
                "answers": tuple(map(tuple, fields["answers"])),
                "arrival": tuple(fields["arrival"]),
                "reached": reached and Event(**reached | {"kind": EventKind(reached["kind"])}),
            }
        )

    def _change(self, fields: dict[str, Any], volumes: Volumes) -> ControlChange:
        intent = fields["intent"]
        return ControlChange(intent and self._intent(volumes, **intent), fields["goal_name"], fields["paused"])

    def _intent(self, volumes: Volumes, kind: str, **fields: Any) -> Intent:
        look_at = _optional(fields["look_at"])
        if kind == "idle":
            return Idle(look_at, _outlines(fields["around"]))
        if kind == "steer":
            velocity, facing = _array(fields["velocity"]), _optional(fields["facing"])
            return Steer(velocity, facing, fields["action"], look_at, _outlines(fields["around"]))
        rotations = _array(fields["rotations"]).reshape(-1, 4)
        return Goal(
            pose=Pose(self._skeleton, _array(fields["root_position"]), rotations),
            action=fields["action"],
            approach=_optional(fields["approach"]),
            obstacles=_outlines(fields["obstacles"]),
            volume=_named(fields["volume"], volumes),
            look_at=look_at,
        )


def _outlines(corners: list[list[list[float]]]) -> tuple[Outline, ...]:
    return tuple(tuple((x, z) for x, z in outline) for outline in corners)


def _named(digest: str | None, volumes: Volumes) -> Volume | None:
    return None if digest is None else volumes[digest]


def _change_fields(change: ControlChange) -> dict[str, Any]:
    intent = None if change.intent is None else _intent_fields(change.intent)
    return {"intent": intent, "goal_name": change.goal_name, "paused": change.paused}


def _intent_fields(intent: Intent) -> dict[str, Any]:
    look_at = None if intent.look_at is None else _text(intent.look_at)
    if isinstance(intent, Idle):
        return {"kind": "idle", "look_at": look_at, "around": intent.around}
    if isinstance(intent, Steer):
        facing = None if intent.facing is None else _text(intent.facing)
        steer = {"velocity": _text(intent.velocity), "facing": facing, "action": intent.action}
        return {"kind": "steer", "look_at": look_at, "around": intent.around, **steer}
    return {
        "kind": "goal",
        "look_at": look_at,
        "root_position": _text(intent.pose.root_position),
        "rotations": _text(intent.pose.rotations),
        "action": intent.action,
        "approach": None if intent.approach is None else _text(intent.approach),
        "obstacles": intent.obstacles,
        "volume": intent.volume and intent.volume.digest,
    }


def _text(values: np.ndarray) -> str:
    return b64encode(np.ascontiguousarray(values, "<f4").tobytes()).decode()


def _optional(text: str | None) -> np.ndarray | None:
    return None if text is None else _array(text)


def _array(text: str) -> np.ndarray:
    return np.frombuffer(b64decode(text), "<f4").astype(np.float32)
