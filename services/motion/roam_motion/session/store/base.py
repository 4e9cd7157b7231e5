"""What every session store promises: one owner a session, and nothing lost that was answered."""

from collections.abc import Mapping
from typing import Protocol

from roam_motion.session.records import Claim, ControlEntry, SessionRecord, Snapshot


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
    """Sessions of all replicas. `nearly_full` once there is only room for those that are there.

    Everything raises StoreDownError when the store does not answer.

    A replica holds sessions under its own name, `owner`, and renews one lease for all of them. Whoever claims a session
    of an owner without a lease gets a higher token, and everything sent with the old token is refused.
    """

    nearly_full: bool

    async def renew(self, owner: str, seconds: float) -> None:
        """The owner is alive for so long from now."""

    async def create(self, record: SessionRecord, owner: str, snapshot: Snapshot) -> str:
        """Stores a new session, token 1; the name of the one with the same request_id instead, if there is one."""

    async def claim(self, name: str, owner: str, key: str = "") -> Claim | None:
        """Takes a session over; None when the API key has none. HeldElsewhereError while its owner is alive."""

    async def log(self, name: str, token: int, entry: ControlEntry) -> None:
        """Writes a control down, over one of the same frame. SupersededError, MissingError."""

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
