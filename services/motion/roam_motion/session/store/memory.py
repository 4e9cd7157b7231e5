"""The session store of a single replica: sessions live as long as the process."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import monotonic

from roam_motion.session.records import Claim, ControlEntry, SessionRecord, Snapshot
from roam_motion.session.store.base import HeldElsewhereError, MissingError, SupersededError


@dataclass
class _Stored:
    record: SessionRecord
    owner: str
    token: int
    expires: float
    snapshots: dict[int, Snapshot] = field(default_factory=dict)
    controls: dict[int, ControlEntry] = field(default_factory=dict)  # by effective sequence


class MemoryStore:
    """Implements `SessionStore` in this process; several replicas in one process may share it."""

    nearly_full = False  # the sessions' own budgets bound it

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._sessions: dict[str, _Stored] = {}
        self._requests: dict[tuple[str, str], str] = {}  # by key's name and request_id
        self._leases: dict[str, float] = {}
        self._asked: dict[str, set[str]] = {}

    async def renew(self, owner: str, seconds: float) -> None:
        """See `SessionStore`."""
        self._leases[owner] = self._clock() + seconds

    async def create(self, record: SessionRecord, owner: str, snapshot: Snapshot) -> str:
        """See `SessionStore`."""
        self._drop_expired()
        if record.request_id:
            known = self._requests.setdefault((record.owner, record.request_id), record.name)
            if known != record.name:
                return known
        stored = _Stored(record, owner, 1, self._clock() + record.idle_timeout)
        stored.snapshots[snapshot.sequence] = snapshot
        self._sessions[record.name] = stored
        return record.name

    async def claim(self, name: str, owner: str, key: str = "") -> Claim | None:
        """See `SessionStore`."""
        self._drop_expired()
        stored = self._sessions.get(name)
        if stored is None or stored.record.owner != key:
            return None
        if stored.owner != owner and self._leases.get(stored.owner, 0) > self._clock():
            raise HeldElsewhereError(stored.owner)
        released, stored.owner, stored.token = not stored.owner, owner, stored.token + 1
        snapshots = tuple(stored.snapshots[key] for key in sorted(stored.snapshots))
        controls = tuple(stored.controls[key] for key in sorted(stored.controls))
        return Claim(stored.record, stored.token, snapshots, controls, released)

    async def log(self, name: str, token: int, entry: ControlEntry) -> None:
        """See `SessionStore`."""
        stored = self._sessions.get(name)
        if stored is None:
            raise MissingError
        _check(stored, token)
        stored.controls[entry.effective] = entry  # stands for an earlier one of the same frame too

    async def save(self, record: SessionRecord, owner: str, token: int, snapshot: Snapshot, keep_from: int) -> None:
        """See `SessionStore`."""
        fresh = _Stored(record, owner, token, self._clock() + record.idle_timeout)
        stored = self._sessions.setdefault(record.name, fresh)
        _check(stored, token)
        stored.snapshots[snapshot.sequence] = snapshot
        stored.snapshots = {key: kept for key, kept in stored.snapshots.items() if key >= keep_from}
        stored.controls = {key: kept for key, kept in stored.controls.items() if kept.effective > keep_from}

    async def release(self, name: str, token: int) -> None:
        """See `SessionStore`."""
        stored = self._sessions.get(name)
        if stored is not None and stored.token == token:
            stored.owner = ""

    async def remove(self, name: str, token: int) -> None:
        """See `SessionStore`."""
        stored = self._sessions.get(name)
        if stored is not None and stored.token == token:
            self._forget(stored)

    async def keep(self, seconds: Mapping[str, float]) -> set[str]:
        """See `SessionStore`."""
        now = self._clock()
        for name in seconds.keys() & self._sessions.keys():
            self._sessions[name].expires = now + seconds[name]
        return set(seconds.keys() - self._sessions.keys())

    async def ask(self, owner: str, name: str) -> None:
        """See `SessionStore`."""
        self._asked.setdefault(owner, set()).add(name)

    async def asked(self, owner: str) -> set[str]:
        """See `SessionStore`."""
        return self._asked.pop(owner, set())

    async def close(self) -> None:
        """See `SessionStore`."""

    def _drop_expired(self) -> None:
        now = self._clock()
        for stored in [stored for stored in self._sessions.values() if stored.expires <= now]:
            self._forget(stored)

    def _forget(self, stored: _Stored) -> None:
        del self._sessions[stored.record.name]
        self._requests.pop((stored.record.owner, stored.record.request_id), None)


def _check(stored: _Stored, token: int) -> None:
    if stored.token != token:
        raise SupersededError
