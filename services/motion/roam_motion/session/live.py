"""The sessions that this replica holds."""

from collections.abc import Callable, Iterator

from roam_serving.errors import ServiceError

from roam_motion.errors import SESSION_QUOTA
from roam_motion.session.session import Session


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
