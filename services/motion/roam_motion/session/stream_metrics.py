"""What the streams tell Prometheus: how soon, how evenly and how completely readers get their frames."""

from collections.abc import Callable
from time import monotonic

from prometheus_client import CollectorRegistry, Counter, Histogram
from roam.v1 import motion_pb2

from roam_motion.session.session import FrameRecord
from roam_motion.session.stream import Item

_FIRST = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5)
_INTERVALS = (0.01, 0.02, 0.03, 0.0325, 0.034, 0.036, 0.04, 0.05, 0.07, 0.1, 0.2, 0.5, 1)  # fine around 1/30 s


class StreamMetrics:
    """Counted where a stream hands an item to its transport."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self._first = Histogram(
            "roam_motion_first_frame_seconds",
            "From opening a stream to its first frame.",
            buckets=_FIRST,
            registry=registry,
        )
        self._intervals = Histogram(
            "roam_motion_frame_interval_seconds",
            "Between two frames of a REALTIME stream.",
            buckets=_INTERVALS,
            registry=registry,
        )
        self._skipped = Counter(
            "roam_motion_frames_skipped", "Frames that readers were too slow for.", registry=registry
        )
        self._resumes = Counter(
            "roam_motion_resumes",
            "Streams that went on after a break: from the ring of the same replica, or from the store.",
            ("path",),
            registry=registry,
        )

    def resumed(self, *, here: bool) -> None:
        """A reader came back; `here` where its session was all the time."""
        self._resumes.labels("ring" if here else "store").inc()

    def reader(self, *, realtime: bool) -> Callable[[Item], None]:
        """What counts the items of one stream, from now on."""
        before, first = monotonic(), True

        def count(item: Item) -> None:
            nonlocal before, first
            if isinstance(item, FrameRecord):
                now = monotonic()
                if first:
                    self._first.observe(now - before)
                elif realtime:
                    self._intervals.observe(now - before)
                before, first = now, False
            elif isinstance(item, motion_pb2.SessionEvent) and item.type == motion_pb2.EVENT_TYPE_FRAMES_SKIPPED:
                self._skipped.inc(item.skipped_count)

        return count
