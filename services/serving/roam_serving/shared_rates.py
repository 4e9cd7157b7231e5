"""A token bucket that several replicas share: one hash per caller in Redis, filled and emptied in one step there.

    roam:rate:{caller}   tokens, at [s of Redis' own clock]; forgotten once the bucket would be full again

A request never waits long for it: where Redis does not answer at once, each replica counts on its own for a while.
"""

from collections.abc import Callable
from time import monotonic

from redis.asyncio import Redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

from roam_serving.monitoring.logs import get_log
from roam_serving.rates import RateLimiter, refusal

log = get_log("serving.rates")

_TIMEOUT = 0.1  # [s] that a request waits for Redis
_ALONE = 1.0  # [s] for which nobody asks it again when it did not answer

_TAKE = """
local rate, burst = tonumber(ARGV[1]), tonumber(ARGV[2])
local time = redis.call('TIME')
local now = tonumber(time[1]) + tonumber(time[2]) / 1e6
local known = redis.call('HMGET', KEYS[1], 'tokens', 'at')
local tokens = tonumber(known[1]) or burst
tokens = math.min(burst, tokens + math.max(0, now - (tonumber(known[2]) or now)) * rate)
local wait = 0
if tokens < 1 then wait = (1 - tokens) / rate else tokens = tokens - 1 end
redis.call('HSET', KEYS[1], 'tokens', string.format('%.6f', tokens), 'at', string.format('%.6f', now))
redis.call('PEXPIRE', KEYS[1], math.ceil(1000 * (burst - tokens) / rate) + 1000)
return string.format('%.6f', wait)
"""


class SharedRateLimiter:
    """At most `burst` requests of a caller at once and `rate` a second [1/s], counted over all replicas of a Redis."""

    def __init__(self, redis: Redis, rate: float, burst: int, clock: Callable[[], float] = monotonic) -> None:
        self._redis, self._rate, self._burst, self._clock = redis, rate, burst, clock
        self._take = redis.register_script(_TAKE)
        self._alone = RateLimiter(rate, burst, clock)
        self._alone_until = float("-inf")

    @staticmethod
    def at(url: str, rate: float, burst: int) -> "SharedRateLimiter":
        """Behind an address such as redis://localhost:6379/0; connects when it is first needed."""
        retry = Retry(NoBackoff(), 1)  # once, for a connection that Redis closed in the meantime
        redis = Redis.from_url(url, socket_timeout=_TIMEOUT, socket_connect_timeout=_TIMEOUT, retry=retry)
        return SharedRateLimiter(redis, rate, burst)

    async def take(self, caller: str) -> None:
        """Counts one request; RATE_LIMITED with the time to wait when the caller has no token left."""
        if self._clock() < self._alone_until:
            self._alone.take(caller)
            return
        try:
            wait = float(await self._take(keys=[f"roam:rate:{caller}"], args=[self._rate, self._burst]))
        except (RedisError, OSError, TimeoutError) as error:
            log.warning("rates are counted by this replica alone", error=str(error))
            self._alone_until = self._clock() + _ALONE
            self._alone.take(caller)
            return
        if wait:
            raise refusal(self._rate, wait)

    async def close(self) -> None:
        """Lets go of connections."""
        await self._redis.aclose()
