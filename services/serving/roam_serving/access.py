"""Who may call, and how often: API keys and rates, asked alike on HTTP, WebSocket and gRPC."""

from collections.abc import Iterable
from contextvars import ContextVar
from pathlib import Path

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from roam_serving.error_replies.closings import closing
from roam_serving.error_replies.problems import problem_response
from roam_serving.errors import API_KEY_MISSING, API_KEY_UNKNOWN, ServiceError
from roam_serving.keys import KeyRing
from roam_serving.monitoring.logs import remember
from roam_serving.rates import RateLimiter
from roam_serving.settings import ServerSettings

CALLER: ContextVar[str] = ContextVar("roam_caller", default="")  # of the request: its key's name, else its address
OWNER: ContextVar[str] = ContextVar("roam_owner", default="")  # the key's name; "" where no keys are asked: all share

_OPEN_PATHS = ("/livez", "/readyz", "/docs", "/openapi.json", "/static-offline-docs/")
_OPEN_METHODS = ("/grpc.health.", "/grpc.reflection.")

# Browsers cannot set headers on a WebSocket: the key comes as one of the subprotocols, the other is the one spoken.
SUBPROTOCOL = "roam.v1"
_KEY_PROTOCOL = "roam.key."


class Access:
    """Admits requests by key and rate; without keys the caller's address counts."""

    def __init__(self, keys: KeyRing | None, rates: RateLimiter | None) -> None:
        self._keys = keys
        self._rates = rates

    @classmethod
    def of(cls, settings: ServerSettings) -> "Access":
        """As the settings say. SettingsError or OSError when the file of keys is not one."""
        keys = KeyRing.read(Path(settings.api_keys)) if settings.api_keys else None
        rate = settings.requests_per_second
        return cls(keys, RateLimiter(rate, settings.request_burst) if rate else None)

    def admit(self, authorization: str, address: str) -> None:
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
        if self._rates is not None:
            self._rates.take(caller)
        CALLER.set(caller)

    def admit_call(self, method: str, metadata: Iterable[tuple[str, str | bytes]], peer: str) -> None:
        """The same for a gRPC method; health checks and reflection are open."""
        if not method.startswith(_OPEN_METHODS):
            authorization = next((str(value) for key, value in metadata if key == "authorization"), "")
            self.admit(authorization, peer.rpartition(":")[0])


class AccessControl:
    """ASGI middleware that asks `Access`; health, docs and CORS preflights are open."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self.app = app
        self.access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
            return
        try:
            if scope["method"] != "OPTIONS" and not scope["path"].startswith(_OPEN_PATHS):
                self.access.admit(Headers(scope=scope).get("authorization", ""), _address(scope))
        except ServiceError as error:
            await problem_response(error)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    async def _websocket(self, scope: Scope, receive: Receive, send: Send) -> None:
        offered = scope.get("subprotocols", [])
        key = next((name.removeprefix(_KEY_PROTOCOL) for name in offered if name.startswith(_KEY_PROTOCOL)), "")

        async def chosen(message: Message) -> None:
            if message["type"] == "websocket.accept" and SUBPROTOCOL in offered:
                message = {**message, "subprotocol": SUBPROTOCOL}
            await send(message)

        try:
            authorization = f"Bearer {key}" if key else Headers(scope=scope).get("authorization", "")
            self.access.admit(authorization, _address(scope))
        except ServiceError as error:
            await receive()  # the close reason reaches the client only on an accepted connection
            await chosen({"type": "websocket.accept"})
            code, reason = closing(error)
            await send({"type": "websocket.close", "code": code, "reason": reason})
            return
        await self.app(scope, receive, chosen)


def _address(scope: Scope) -> str:
    client = scope.get("client")
    return str(client[0]) if client else "unknown"
