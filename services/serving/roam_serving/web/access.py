"""Access on HTTP and WebSocket: keys from headers or subprotocols, refusals as problems and closings."""

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from roam_serving.access import Access
from roam_serving.error_replies.closings import closing
from roam_serving.error_replies.problems import problem_response
from roam_serving.errors import ServiceError

_OPEN_PATHS = ("/livez", "/readyz", "/docs", "/openapi.json", "/static-offline-docs/")

# Browsers cannot set headers on a WebSocket: the key comes as one of the subprotocols, the other is the one spoken.
SUBPROTOCOL = "roam.v1"
_KEY_PROTOCOL = "roam.key."


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
                await self.access.admit(Headers(scope=scope).get("authorization", ""), _address(scope))
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
            await self.access.admit(authorization, _address(scope))
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
