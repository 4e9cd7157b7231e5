"""Which sessions this replica may move: it claims them, writes down what happens to them, and lets them go.

One lease stands for all sessions of a replica. It counts from before it was asked for, so it ends here no later than in
the store: when another replica may claim a session, this one has stopped moving it.
"""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from uuid import uuid4
from weakref import WeakValueDictionary

from roam_serving.errors import ServiceError
from roam_serving.monitoring.logs import get_log

from roam_motion.errors import CONTROL_BUDGET, SESSION_ELSEWHERE, SESSION_NOT_FOUND, SESSION_QUOTA, STORE_DOWN
from roam_motion.session.records import Claim, ControlEntry, Event, EventKind, Snapshot
from roam_motion.session.session import Session
from roam_motion.session.store.base import (
    HeldElsewhereError,
    MissingError,
    SessionStore,
    StoreDownError,
    SupersededError,
)

log = get_log("roam_motion.session.ownership")

_RENEWALS = 3  # per lease
_CLAIM_LEASES = 3  # so many leases long a request waits for a session that another replica holds
_KEEP_SECONDS = 2.0  # between two notes to the store that sessions are in use
_WAIT_FOR_ROOM = 10.0  # [s] advised while the store is nearly full
_LARGE = 4096  # [bytes] of a control that is refused then
_KEEP_SLACK = 10.0  # the store keeps a session so much longer than its idle timeout [s]

_RECONNECT = 10  # [s] within which readers of a session that goes elsewhere come back

_MOVED = Event(
    EventKind.DRAINING, message="this server lets the session go; reconnect", reconnect_within=_RECONNECT
)  # what readers hear of a session that goes on elsewhere


class LiveSessions:
    """Sessions by name, in order of creation, at most `limit` of them."""

    def __init__(self, limit: int, clock: Callable[[], float]) -> None:
        self._limit = limit
        self._clock = clock
        self._sessions: dict[str, Session] = {}

    def __len__(self) -> int:
        return len(self._sessions)

    def __iter__(self) -> Iterator[Session]:
        return iter(list(self._sessions.values()))

    def get(self, name: str) -> Session | None:
        """A session that is held here."""
        return self._sessions.get(name)

    def add(self, session: Session) -> None:
        """Takes a session in; SESSION_QUOTA when no further one fits."""
        if len(self._sessions) >= self._limit:
            soonest = min(session.expire_time for session in self._sessions.values())
            wait = max(1.0, soonest - self._clock())
            raise ServiceError(SESSION_QUOTA, f"{self._limit} sessions are alive", retry_after=round(wait, 1))
        self._sessions[session.name] = session

    def discard(self, session: Session) -> bool:
        """Lets a session go; false when it was gone already."""
        if self._sessions.get(session.name) is not session:
            return False
        del self._sessions[session.name]
        return True

    def expired(self) -> list[Session]:
        """Sessions whose idle timeout has passed without a client."""
        now = self._clock()
        return [session for session in self if not session.streams and session.expire_time <= now]


class Ownership:
    """The link between the live sessions and the store; all methods run on the event loop.

    `make` gives a session in a snapshot's state. Frames are only promised to be exact where the same `build` made them.
    """

    def __init__(
        self,
        store: SessionStore,
        live: LiveSessions,
        make: Callable[[Claim, Snapshot], Session],
        *,
        build: str,
        lease: float,
        snapshot_frames: int,
        history_frames: int,
        on_health: Callable[[bool], None] = lambda well: None,
        on_progress: Callable[[], None] = lambda: None,
    ) -> None:
        self.replica = uuid4().hex
        self._store = store
        self._live = live
        self._make = make
        self._build = build
        self._lease = lease  # [s]
        self._snapshot_frames = snapshot_frames
        self._history_frames = history_frames
        self.reach = 2 * snapshot_frames  # how far a session goes beyond its last snapshot in the store [frames]
        self._on_health = on_health
        self._on_progress = on_progress  # a session may go further than before
        self._valid_until = float("-inf")  # [s], monotonic
        self._tokens: dict[str, int] = {}
        self._locks: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        self._unsaved: dict[str, Session] = {}  # sessions whose snapshot is due, in order
        self._removed: list[tuple[str, int]] = []  # sessions that the store shall forget
        self._work = asyncio.Event()
        self._kept = 0.0

    @property
    def valid(self) -> bool:
        """Whether sessions may be moved right now."""
        return monotonic() < self._valid_until

    # Sessions come and go

    async def create(self, session: Session) -> Session:
        """Takes a new session in, or the one that the same request_id made before."""
        if self._store.nearly_full:
            raise ServiceError(SESSION_QUOTA, "the store of sessions is nearly full", retry_after=_WAIT_FOR_ROOM)
        self._live.add(session)
        self._tokens[session.name] = 1
        try:
            with _answering():
                name = await self._store.create(session.record, self.replica, session.snapshot(self._build))
        except ServiceError:
            self._let_go(session)
            raise
        if name == session.name:
            session.limit = self.reach
            return session
        self._let_go(session)
        return await self.hold(name, session.record.owner)

    async def hold(self, name: str, key: str, *, after_sequence: int = 0, insist: bool = False) -> Session:
        """A session of an API key, claimed if need be: restored so that frames after `after_sequence` can follow.

        Waits while another replica holds it, and with `insist` asks that one to give it up. SESSION_NOT_FOUND,
        SESSION_ELSEWHERE, STORE_DOWN, SESSION_QUOTA.
        """
        if session := self._live.get(name):
            return _of(session, key)
        async with self._lock(name):
            return _of(self._live.get(name) or await self._take(name, key, after_sequence, insist), key)

    async def rewind(self, session: Session, after_sequence: int) -> Session:
        """The same session from an older snapshot, for a reader who wants frames that were not computed here."""
        async with self._lock(session.name):
            if self._live.get(session.name) is session:
                with _answering(), suppress(SupersededError):  # then claiming tells who has it
                    await self._save(session, self._tokens[session.name])
                self._let_go(session)
                session.ended = True
            again = session.name, session.record.owner, after_sequence
            return self._live.get(session.name) or await self._take(*again, insist=False)

    def _lock(self, name: str) -> asyncio.Lock:
        return self._locks.setdefault(name, asyncio.Lock())

    async def _take(self, name: str, key: str, after_sequence: int, insist: bool) -> Session:
        claim = await self._claim(name, key, insist)
        session = self._restored(claim, after_sequence)
        session.limit = claim.snapshots[-1].sequence + self.reach
        self._live.add(session)
        self._tokens[name] = claim.token
        log.info("claimed", session=name, token=claim.token, sequence=session.sequence)
        return session

    def _restored(self, claim: Claim, after_sequence: int) -> Session:
        """A claimed session, ready to compute what follows `after_sequence` (0: the newest that is known)."""
        snapshot, last = claim.snapshot_before(after_sequence), claim.snapshots[-1]
        session = self._make(claim, snapshot)
        shown = max(last.shown, last.sequence + (0 if claim.released else self.reach))
        session.restore(snapshot, claim, shown=shown)
        session.exact = snapshot.build == self._build
        return session

    async def _claim(self, name: str, key: str, insist: bool) -> Claim:
        deadline = monotonic() + _CLAIM_LEASES * self._lease
        while True:
            try:
                with _answering():
                    claim = await self._store.claim(name, self.replica, key)
            except HeldElsewhereError as held:
                if monotonic() > deadline:
                    raise ServiceError(SESSION_ELSEWHERE, str(held), retry_after=self._lease) from None
                if insist:
                    with _answering():
                        await self._store.ask(held.owner, name)
                await asyncio.sleep(self._lease / 10)
                continue
            if claim is None:
                raise _not_found(name)
            return claim

    def remove(self, session: Session, message: str) -> None:
        """Ends a session, frees its place at once, and has the store forget it in a while."""
        if token := self._let_go(session):
            self._removed.append((session.name, token))
            self._work.set()
        session.end(Event(EventKind.SESSION_ENDED, message=message))

    async def delete(self, session: Session) -> None:
        """Ends a session that its client does not want any more; the store has forgotten it when this returns."""
        self.remove(session, "deleted")
        with _answering():
            await self._forget()

    async def release(self, session: Session) -> None:
        """Gives a session up, as it is now, to whoever claims it next."""
        token = self._let_go(session)
        session.end(_MOVED)
        if token is None:
            return
        try:
            await self._save(session, token)
            await self._store.release(session.name, token)
        except (StoreDownError, SupersededError) as error:
            log.warning("session not handed over", session=session.name, error=repr(error))

    def _let_go(self, session: Session) -> int | None:
        self._unsaved.pop(session.name, None)
        return self._tokens.pop(session.name, None) if self._live.discard(session) else None

    # What happens to them

    async def record(self, session: Session, entry: ControlEntry) -> None:
        """Writes a control down before it takes effect. STORE_DOWN, SESSION_ELSEWHERE, CONTROL_BUDGET."""
        if self._store.nearly_full and entry.change.size > _LARGE:
            raise ServiceError(CONTROL_BUDGET, "the store of sessions is nearly full", retry_after=_WAIT_FOR_ROOM)
        token = self._tokens.get(session.name, 0)
        with _answering():
            try:
                try:
                    await self._store.log(session.name, token, entry)
                except MissingError:
                    await self._save(session, token)
                    await self._store.log(session.name, token, entry)
            except (SupersededError, MissingError) as error:
                self._lose(session)
                raise ServiceError(SESSION_ELSEWHERE, "another replica has taken it over", retry_after=0.1) from error

    def advanced(self, session: Session) -> None:
        """A session has moved; now and then that is worth a snapshot."""
        # sessions take their turns, so that no frame waits for many snapshots
        if (session.sequence + int(session.name[-2:], 16)) % self._snapshot_frames == 0:
            self._unsaved[session.name] = session
            self._work.set()

    async def _save(self, session: Session, token: int) -> None:
        snapshot = session.snapshot(self._build)
        keep_from = max(0, snapshot.sequence - self._history_frames)
        await self._store.save(session.record, self.replica, token, snapshot, keep_from)
        if snapshot.sequence + self.reach > session.limit:  # a session that replays saves older ones too
            session.limit = snapshot.sequence + self.reach
            self._on_progress()

    def _lose(self, session: Session) -> None:
        log.warning("session was taken over", session=session.name)
        self._let_go(session)
        session.end(_MOVED)

    async def close(self) -> None:
        """Lets go of the store."""
        await self._store.close()

    # In the background

    async def run(self) -> None:
        """Renews the lease and writes snapshots, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._renew_for_ever())
            tasks.create_task(self._write_for_ever())

    async def renew(self) -> None:
        """Renews the lease once. After a lapse, sessions that others have claimed since are let go first."""
        asked = monotonic()
        await self._store.renew(self.replica, self._lease)
        if asked > self._valid_until:
            await asyncio.gather(*(self._verify(session) for session in self._live))
        self._valid_until = asked + self._lease

    async def _verify(self, session: Session) -> None:
        try:
            await self._save(session, self._tokens[session.name])
        except (SupersededError, KeyError):
            self._lose(session)

    async def _renew_for_ever(self) -> None:
        well = True
        while True:
            try:
                await self.renew()
                await self._give_what_is_asked_for()
                await self._keep()
            except StoreDownError as error:
                if well:
                    log.error("the session store does not answer", error=str(error))
                    self._on_health(False)
                well = False
            else:
                if not well:
                    log.info("the session store answers again")
                    self._on_health(True)
                well = True
            await asyncio.sleep(min(self._lease / _RENEWALS, _KEEP_SECONDS))

    async def _give_what_is_asked_for(self) -> None:
        for name in await self._store.asked(self.replica):
            if session := self._live.get(name):
                await self.release(session)

    async def _keep(self) -> None:
        now = monotonic()
        if now < self._kept + _KEEP_SECONDS or not len(self._live):
            return
        self._kept = now
        lost = await self._store.keep(
            {session.name: session.record.idle_timeout + _KEEP_SLACK for session in self._live}
        )
        self._unsaved |= {session.name: session for session in self._live if session.name in lost}
        self._work.set()

    async def _write_for_ever(self) -> None:
        while True:
            await self._work.wait()
            self._work.clear()
            try:
                await self._write()
            except StoreDownError:
                await asyncio.sleep(self._lease)  # renewing tells of it
                self._work.set()

    async def _forget(self) -> None:
        while self._removed:
            name, token = self._removed.pop()
            try:
                await self._store.remove(name, token)
            except StoreDownError:
                self._removed.append((name, token))
                raise

    async def _write(self) -> None:
        await self._forget()
        while self._unsaved:
            name, session = next(iter(self._unsaved.items()))
            try:
                await self._save(session, self._tokens[name])
            except SupersededError:
                self._lose(session)
            self._unsaved.pop(name, None)


def _of(session: Session, key: str) -> Session:
    """The session, for whoever has its key; for others there is none."""
    if session.record.owner != key:
        raise _not_found(session.name)
    return session


def _not_found(name: str) -> ServiceError:
    return ServiceError(SESSION_NOT_FOUND, f"no session {name[:100]!r}", field="session")


@contextmanager
def _answering() -> Iterator[None]:
    """Turns a store that does not answer into STORE_DOWN."""
    try:
        yield
    except StoreDownError as error:
        raise ServiceError(STORE_DOWN, str(error), retry_after=1.0) from error
