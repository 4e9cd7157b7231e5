"""Whether a server can answer, and why not."""

from collections.abc import Callable, Mapping


class Readiness:
    """Conditions by name; the server is ready when none of them is blocked.

    Feeds /readyz and grpc.health.v1, so that an orchestrator and a person read the same reason.
    """

    def __init__(self) -> None:
        self._blockers: dict[str, str] = {}
        self._broken: dict[str, str] = {}
        self._listeners: list[Callable[[bool], None]] = []

    @property
    def alive(self) -> bool:
        """False once a part has failed for good: only a new process helps."""
        return not self._broken

    @property
    def failures(self) -> Mapping[str, str]:
        """Reason of every part that has failed for good."""
        return dict(self._broken)

    def fail(self, condition: str, reason: str) -> None:
        """Says that `condition` will never hold again in this process: not ready, and /livez fails too."""
        self._broken[condition] = reason
        self.block(condition, reason)

    @property
    def ready(self) -> bool:
        """True when nothing blocks."""
        return not self._blockers

    @property
    def blockers(self) -> Mapping[str, str]:
        """Reason of every blocked condition."""
        return dict(self._blockers)

    def block(self, condition: str, reason: str) -> None:
        """Says that `condition` does not hold, and why."""
        self._blockers[condition] = reason
        self._tell()

    def clear(self, condition: str) -> None:
        """Says that `condition` holds."""
        self._blockers.pop(condition, None)
        self._tell()

    def listen(self, listener: Callable[[bool], None]) -> None:
        """Calls `listener(ready)` now and after every change."""
        self._listeners.append(listener)
        listener(self.ready)

    def _tell(self) -> None:
        for listener in self._listeners:
            listener(self.ready)
