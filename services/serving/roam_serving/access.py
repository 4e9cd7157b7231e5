"""Who may call, and how often: API keys and rates, asked alike on HTTP, WebSocket and gRPC."""

from collections.abc import Iterable
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING

from roam_serving.errors import API_KEY_MISSING, API_KEY_UNKNOWN, ServiceError
from roam_serving.keys import KeyRing
from roam_serving.monitoring.logs import remember
from roam_serving.rates import RateLimiter
from roam_serving.settings import ServerSettings

if TYPE_CHECKING:
    from roam_serving.shared_rates import SharedRateLimiter

CALLER: ContextVar[str] = ContextVar("roam_caller", default="")  # of the request: its key's name, else its address
OWNER: ContextVar[str] = ContextVar("roam_owner", default="")  # the key's name; "" where no keys are asked: all share

_OPEN_METHODS = ("/grpc.health.", "/grpc.reflection.")


class Access:
    """Admits requests by key and rate; without keys the caller's address counts."""

    def __init__(self, keys: KeyRing | None, rates: "RateLimiter | SharedRateLimiter | None") -> None:
        self._keys = keys
        self._rates = rates

    @classmethod
    def of(cls, settings: ServerSettings) -> "Access":
        """As the settings say. SettingsError or OSError when the file of keys is not one."""
        keys = KeyRing.read(Path(settings.api_keys)) if settings.api_keys else None
        rate, burst, store = settings.requests_per_second, settings.request_burst, settings.rate_store
        if not rate:
            return cls(keys, None)
        if not store:
            return cls(keys, RateLimiter(rate, burst))
        from roam_serving.shared_rates import SharedRateLimiter  # redis: only where it is asked for

        return cls(keys, SharedRateLimiter.at(store, rate, burst))

    async def close(self) -> None:
        """Lets go of what counts the rates."""
        if self._rates is not None and not isinstance(self._rates, RateLimiter):
            await self._rates.close()

    async def admit(self, authorization: str, address: str) -> None:
        """Lets a request in and remembers its caller; API_KEY_MISSING, API_KEY_UNKNOWN or RATE_LIMITED otherwise."""
        caller = address
        if self._keys is not None:
            scheme, _, key = authorization.partition(" ")
            if scheme.lower() != "bearer" or not key.strip():
                raise ServiceError(API_KEY_MISSING)
            name = self._keys.name_of(key.strip())
            if name is None:
                raise ServiceError(API_KEY_UNKNOWN)
            caller = name
            OWNER.set(name)
            remember(caller=caller)
        if isinstance(self._rates, RateLimiter):
            self._rates.take(caller)
        elif self._rates is not None:
            await self._rates.take(caller)
        CALLER.set(caller)

    async def admit_call(self, method: str, metadata: Iterable[tuple[str, str | bytes]], peer: str) -> None:
        """The same for a gRPC method; health checks and reflection are open."""
        if not method.startswith(_OPEN_METHODS):
            authorization = next((str(value) for key, value in metadata if key == "authorization"), "")
            await self.admit(authorization, peer.rpartition(":")[0])
