"""What outlives a replica: a session's terms, its snapshots, and the controls taken since.

A frame depends on nothing but the seed and the controls before it. So whoever has a snapshot and the controls after it
computes the same frames again, and goes on where the replica that died had stopped.
"""

from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import orjson


@dataclass(frozen=True)
class SessionRecord:
    """The terms of a session; they never change."""

    name: str  # "sessions/{id}"
    resume_token: str
    request_id: str
    skeleton_id: str
    create_time: float  # [s since 1970]
    idle_timeout: float  # [s]
    floor_height: float  # [m]


@dataclass(frozen=True)
class ControlEntry:
    """A control that was taken."""

    control_id: int
    effective: int  # first frame it can affect
    control: bytes  # a motion_pb2.ControlInput


@dataclass(frozen=True)
class Snapshot:
    """A session between two frames."""

    sequence: int
    state: bytes
    control: bytes  # the motion_pb2.ControlInput whose intent is in force; empty: none yet
    paused: bool
    last_control_id: int
    answers: tuple[tuple[int, int], ...]  # control_id, effective sequence
    watch: tuple[int, float | None, bool]  # the goal watch's near, last and told
    reached: bytes  # the last GOAL_REACHED, a motion_pb2.SessionEvent
    build: str  # what computed the frames; where this differs they may differ in the last bits. "": mixed
    shown: int = 0  # a replica that died may have shown frames up to here


@dataclass(frozen=True)
class Claim:
    """A session taken over: everything there is to know of it, and the token that now fences all others off."""

    record: SessionRecord
    token: int
    snapshots: tuple[Snapshot, ...]  # oldest first, at least one
    controls: tuple[ControlEntry, ...]  # in order
    released: bool  # the owner gave it up after the last snapshot; else it may have gone on from there


class StoreDownError(Exception):
    """The store did not answer."""


class HeldElsewhereError(Exception):
    """Another replica, which is alive, holds the session."""

    def __init__(self, owner: str) -> None:
        super().__init__(f"held by replica {owner}")
        self.owner = owner


class SupersededError(Exception):
    """The session was taken over since; whatever the holder of the old token computes counts no more."""


class MissingError(Exception):
    """The store has lost a session; its holder can save it anew."""


class SessionStore(Protocol):
    """Sessions of all replicas. Everything raises StoreDownError when the store does not answer.

    A replica holds sessions under its own name, `owner`, and renews one lease for all of them. Whoever claims a session
    of an owner without a lease gets a higher token, and everything sent with the old token is refused.
    """

    async def renew(self, owner: str, seconds: float) -> None:
        """The owner is alive for so long from now."""

    async def create(self, record: SessionRecord, owner: str, snapshot: Snapshot) -> str:
        """Stores a new session, token 1; the name of the one with the same request_id instead, if there is one."""

    async def claim(self, name: str, owner: str) -> Claim | None:
        """Takes a session over; None when there is none. HeldElsewhereError while its owner is alive."""

    async def log(self, name: str, token: int, entry: ControlEntry) -> None:
        """Writes a control down. SupersededError, MissingError."""

    async def save(self, record: SessionRecord, owner: str, token: int, snapshot: Snapshot, keep_from: int) -> None:
        """Adds a snapshot and drops what only leads to frames before `keep_from`; stores all anew where it was lost.

        SupersededError.
        """

    async def release(self, name: str, token: int) -> None:
        """Gives a session up, so that it can be claimed at once. Nothing happens when it is superseded."""

    async def remove(self, name: str, token: int) -> None:
        """Forgets a session. Nothing happens when it is superseded."""

    async def keep(self, seconds: Mapping[str, float]) -> set[str]:
        """Keeps sessions for so long from now; the names of those that the store does not have."""

    async def ask(self, owner: str, name: str) -> None:
        """Asks an owner to give a session up."""

    async def asked(self, owner: str) -> set[str]:
        """What others have asked this owner for since the last time."""

    async def close(self) -> None:
        """Lets go of connections."""


def encode(value: SessionRecord | Snapshot | ControlEntry) -> bytes:
    """As JSON, bytes in base64."""
    return orjson.dumps({key: _text(item) for key, item in asdict(value).items()})


def decode_record(data: bytes) -> SessionRecord:
    """What `encode` wrote."""
    return SessionRecord(**orjson.loads(data))


def decode_control(data: bytes) -> ControlEntry:
    """What `encode` wrote."""
    fields: dict[str, Any] = orjson.loads(data)
    return ControlEntry(**fields | {"control": b64decode(fields["control"])})


def decode_snapshot(data: bytes) -> Snapshot:
    """What `encode` wrote."""
    fields: dict[str, Any] = orjson.loads(data)
    fields |= {name: b64decode(fields[name]) for name in ("state", "control", "reached")}
    fields |= {"answers": tuple(map(tuple, fields["answers"])), "watch": tuple(fields["watch"])}
    return Snapshot(**fields)


def _text(value: Any) -> Any:
    return b64encode(value).decode() if isinstance(value, bytes) else value
