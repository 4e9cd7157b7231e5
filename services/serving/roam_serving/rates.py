"""Token buckets: how often one caller may ask."""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

from roam_serving.cache import RecentCache
from roam_serving.errors import RATE_LIMITED, ServiceError

_CALLERS = 10_000  # buckets kept; a caller who was away so long that it is forgotten starts with a full one


@dataclass
class _Bucket:
    tokens: float
    filled_at: float  # [s]


def refusal(rate: float, wait: float) -> ServiceError:
    """RATE_LIMITED at so many requests a second [1/s], to be tried again after `wait` [s]."""
    return ServiceError(RATE_LIMITED, f"{rate:g} requests a second are allowed", retry_after=round(wait, 2))


class RateLimiter:
    """At most `burst` requests at once and `rate` a second [1/s] in the long run, for every caller on its own."""

    def __init__(self, rate: float, burst: int, clock: Callable[[], float] = monotonic) -> None:
        self._rate = rate
        self._burst = burst
        self._clock = clock
        self._buckets = RecentCache[str, _Bucket](_CALLERS)

    def take(self, caller: str) -> None:
        """Counts one request; RATE_LIMITED with the time to wait when the caller has no token left."""
        now = self._clock()
        bucket = self._buckets.get(caller)
        if bucket is None:
            bucket = _Bucket(float(self._burst), now)
            self._buckets.put(caller, bucket)
        bucket.tokens = min(self._burst, bucket.tokens + (now - bucket.filled_at) * self._rate)
        bucket.filled_at = now
        if bucket.tokens < 1:
            raise refusal(self._rate, (1 - bucket.tokens) / self._rate)
        bucket.tokens -= 1
