"""The HTTP side of a server: FastAPI with problem documents, request ids, metrics, health and offline /docs."""

import re
from collections.abc import Iterable, Mapping
from time import monotonic
from typing import Any

from fastapi import APIRouter, FastAPI, Response
from fastapi_offline import FastAPIOffline
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.responses import JSONResponse, PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from roam_serving.access import Access, AccessControl
from roam_serving.error_replies.closings import closing
from roam_serving.error_replies.problems import PROBLEM_RESPONSES, add_problem_handlers, problem_response
from roam_serving.errors import HOST_NOT_ALLOWED, INTERNAL, ORIGIN_NOT_ALLOWED, ServiceError
from roam_serving.monitoring.logs import choose_request_id, get_log, request_scope
from roam_serving.monitoring.metrics import Metrics
from roam_serving.monitoring.readiness import Readiness
from roam_serving.monitoring.tracing import Tracing
from roam_serving.settings import ServerSettings

log = get_log("serving.http")

_QUIET = {"/livez", "/readyz", "/metrics"}  # asked every few seconds by machines


def limited_receive(scope: Scope, receive: Receive, limit: int) -> Receive:
    """`receive` that refuses a body of more than `limit` bytes, announced or not, before it is held in memory."""
    seen = 0
    announced = int(Headers(scope=scope).get("content-length", "0") or 0)

    async def counted() -> Message:
        nonlocal seen
        if announced > limit:
            raise HTTPException(413, f"body of {announced} bytes; at most {limit} are accepted")
        message = await receive()
        seen += len(message.get("body", b""))
        if seen > limit:
            raise HTTPException(413, f"body of more than {limit} bytes")
        return message

    return counted


class AllowedHosts:
    """The names under which a server answers (`Host`), against DNS rebinding.

    A web page whose name resolves to 127.0.0.1 is of the same origin as this server for its browser, so its requests
    carry no foreign `Origin`; but they carry the page's name as `Host`. What orchestrators ask under any name is open.
    """

    def __init__(self, allowed: str, listening: str) -> None:
        names = {name.strip().lower() for name in allowed.split(",") if name.strip()}
        own = f"[{listening}]" if ":" in listening else listening
        self._names = names if "*" in names else names | {own.lower()}

    def check(self, scope: Scope) -> None:
        """HOST_NOT_ALLOWED for a request under another name."""
        if "*" in self._names or scope["path"] in _QUIET:
            return
        host = Headers(scope=scope).get("host", "")
        if _hostname(host) not in self._names:
            raise ServiceError(HOST_NOT_ALLOWED, f"host {host[:200]!r}")


def _hostname(host: str) -> str:
    """`Host` without its port, in lower case; brackets stay on an IPv6 address."""
    name = host.lower()
    return name[: name.find("]") + 1] if name.startswith("[") else name.partition(":")[0]


class RequestScope:
    """ASGI middleware: request id, origin, size limit, last resort 500; one log line and one metric per request."""

    def __init__(self, app: ASGIApp, metrics: Metrics, settings: ServerSettings, tracing: Tracing) -> None:
        self.app = app
        self.metrics = metrics
        self.tracing = tracing
        self.limit = settings.max_upload_bytes
        self.origins = re.compile(settings.cors_origin_regex)
        self._hosts = AllowedHosts(settings.allowed_hosts, settings.host)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
            return
        request_id = choose_request_id(Headers(scope=scope).get("x-request-id"))
        status = 0

        async def tagged(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)["X-Request-Id"] = request_id
            await send(message)

        start = monotonic()
        with (
            request_scope(request_id),
            self.metrics.in_flight.labels("http").track_inprogress(),
            self.tracing.span(f"{scope['method']} {scope['path']}", Headers(scope=scope)) as span,
        ):
            try:
                self._hosts.check(scope)
                self._check_origin(scope)
                await self.app(scope, limited_receive(scope, receive, self.limit), tagged)
            except ServiceError as error:
                await problem_response(error)(scope, receive, tagged)
            except Exception as error:
                log.exception("request failed", path=scope["path"])
                if not status:
                    await problem_response(ServiceError(INTERNAL, type(error).__name__))(scope, receive, tagged)
            finally:
                self._count(scope, status or 499, monotonic() - start)
                if span is not None:
                    span.set_attribute("http.response.status_code", status or 499)
                    span.set_attribute("roam.request_id", request_id)

    async def _websocket(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            self._hosts.check(scope)
            self._check_origin(scope)
        except ServiceError as error:
            code, reason = closing(error)
            await send({"type": "websocket.close", "code": code, "reason": reason})
            return
        with request_scope(choose_request_id(Headers(scope=scope).get("x-request-id"))):
            await self.app(scope, receive, send)

    def _check_origin(self, scope: Scope) -> None:
        """Refuses foreign web pages: CORS alone would hide the answer from them, but still do what they asked."""
        headers = Headers(scope=scope)
        origin = headers.get("origin")
        if origin is None or self.origins.fullmatch(origin) or origin.partition("://")[2] == headers.get("host"):
            return
        raise ServiceError(ORIGIN_NOT_ALLOWED, f"origin {origin[:200]!r}")

    def _count(self, scope: Scope, status: int, seconds: float) -> None:
        route = scope.get("route")
        method = f"{scope['method']} {getattr(route, 'path', 'unknown')}"
        self.metrics.requests.labels("http", method, str(status)).inc()
        self.metrics.request_seconds.labels("http", method).observe(seconds)
        level = log.debug if scope["path"] in _QUIET else log.info
        level("request", method=scope["method"], path=scope["path"], status=status, seconds=round(seconds, 4))


def operations_router(readiness: Readiness, metrics: Metrics) -> APIRouter:
    """/livez, /readyz and /metrics."""
    router = APIRouter(tags=["operations"])

    @router.get("/livez", summary="The process works; 503 with the reasons when only a restart helps")
    async def livez() -> JSONResponse:
        body = {"status": "alive"} if readiness.alive else {"status": "failed", "failures": dict(readiness.failures)}
        return JSONResponse(body, status_code=200 if readiness.alive else 503)

    @router.get("/readyz", summary="The server can answer; 503 with the reasons when it cannot")
    async def readyz() -> JSONResponse:
        body: Mapping[str, Any] = {"status": "ready" if readiness.ready else "blocked", "blockers": readiness.blockers}
        return JSONResponse(body, status_code=200 if readiness.ready else 503)

    @router.get("/metrics", summary="Prometheus metrics", response_class=PlainTextResponse)
    async def exposition() -> Response:
        return Response(metrics.exposition(), media_type="text/plain; version=0.0.4; charset=utf-8")

    return router


def create_http_app(
    *,
    title: str,
    version: str,
    routers: Iterable[APIRouter],
    readiness: Readiness,
    metrics: Metrics,
    settings: ServerSettings,
    access: Access,
    tracing: Tracing,
) -> FastAPI:
    """The application: the services' routers plus what every server has."""
    app: FastAPI = FastAPIOffline(title=title, version=version, redoc_url=None, responses=PROBLEM_RESPONSES)
    app.include_router(operations_router(readiness, metrics))
    for router in routers:
        app.include_router(router)
    add_problem_handlers(app)
    app.add_middleware(AccessControl, access=access)  # the first added is the innermost: refusals get CORS headers too
    app.add_middleware(
        CORSMiddleware,
        allow_origin_regex=settings.cors_origin_regex,
        allow_methods=["*"],
        allow_headers=["*"],
        expose_headers=["X-Request-Id", "X-Roam-Cache", "Retry-After"],
    )
    app.add_middleware(RequestScope, metrics=metrics, settings=settings, tracing=tracing)
    return app
