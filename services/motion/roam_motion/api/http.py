"""The motion service over HTTP: a thin translation of MotionApplication."""

from collections.abc import AsyncIterator, Callable
from contextlib import aclosing
from typing import Annotated, Any, Literal

import orjson
from fastapi import APIRouter, Header, Query, Response
from fastapi.responses import StreamingResponse
from sse_starlette import EventSourceResponse

from roam_motion.api import validation
from roam_motion.api.schemas import ControlJson, ControlledJson, CreateSessionJson, SessionJson, SessionsJson, item_json
from roam_motion.session.application import MotionApplication
from roam_motion.session.session import FrameRecord
from roam_motion.session.stream import Pacing, StreamOptions

NDJSON = "application/x-ndjson"


def motion_router(application: Callable[[], MotionApplication]) -> APIRouter:
    """The routes under /v1/sessions; `application` is called per request."""
    router = APIRouter(prefix="/v1/sessions", tags=["motion"])

    @router.post("", status_code=201, summary="Create a session: one character")
    async def create_session(
        body: CreateSessionJson | None = None,
        x_roam_session: Annotated[str, Header(include_in_schema=False)] = "",  # set by gateways
    ) -> SessionJson:
        request = (body or CreateSessionJson()).request()
        return SessionJson.of(await application().create_session(request, x_roam_session))

    @router.get("", summary="List sessions")
    async def list_sessions(
        page_size: Annotated[int, Query(ge=0)] = 0, page_token: Annotated[str, Query()] = ""
    ) -> SessionsJson:
        sessions, token = application().list_sessions(page_size, page_token)
        return SessionsJson(sessions=[SessionJson.of(session) for session in sessions], next_page_token=token)

    @router.get("/{session}", summary="Read a session")
    async def get_session(session: str) -> SessionJson:
        return SessionJson.of(await application().get_session(f"sessions/{session}"))

    @router.delete("/{session}", status_code=204, summary="End a session")
    async def delete_session(session: str) -> Response:
        await application().delete_session(f"sessions/{session}")
        return Response(status_code=204)

    @router.post("/{session}/control", summary="Steer, give a goal, pause or go on")
    async def control(session: str, body: ControlJson) -> ControlledJson:
        motion = application()
        effective = await motion.control(f"sessions/{session}", body.request(motion.skeleton))
        return ControlledJson(effective_sequence=effective)

    _add_frames(router, application)
    return router


def _add_frames(router: APIRouter, application: Callable[[], MotionApplication]) -> None:
    @router.get(
        "/{session}/frames",
        summary="Frames as JSON lines, or as server-sent events with Accept: text/event-stream",
        response_class=StreamingResponse,
        responses={200: {"content": {NDJSON: {}, "text/event-stream": {}}}},
    )
    async def frames(
        session: str,
        pacing: Annotated[Literal["realtime", "burst"], Query()] = "realtime",
        count: Annotated[int | None, Query(ge=1, description="end after this many frames")] = None,
        after_sequence: Annotated[int, Query(ge=0, lt=1 << 32, description="last frame you have")] = 0,
        positions: Annotated[bool, Query(description="also send joint positions")] = False,
        accept: Annotated[str, Header()] = "",
        last_event_id: Annotated[str, Header(description="as EventSource sends it; counts more than the query")] = "",
    ) -> Response:
        options = StreamOptions(Pacing(pacing), validation.event_id(last_event_id) or after_sequence)
        lines = frame_lines(application(), f"sessions/{session}", options, count=count, positions=positions)
        first = await anext(lines)  # errors of opening come before the status line
        if "text/event-stream" in accept:
            return EventSourceResponse(_events(first, lines))
        return StreamingResponse(_ndjson(first, lines), media_type=NDJSON)


async def frame_lines(
    application: MotionApplication, session: str, options: StreamOptions, *, count: int | None, positions: bool
) -> AsyncIterator[dict[str, Any]]:
    """The stream's items as JSON objects, at most `count` frames of them."""
    left = count
    async with application.stream(session, options) as stream:
        async for item in stream:
            yield item_json(item, stream.session, positions=positions)
            if isinstance(item, FrameRecord) and left is not None:
                left -= 1
                if left == 0:
                    return


async def _ndjson(first: dict[str, Any], rest: AsyncIterator[dict[str, Any]]) -> AsyncIterator[bytes]:
    yield orjson.dumps(first) + b"\n"
    async with aclosing(rest) as lines:  # type: ignore[type-var]  # an async generator
        async for line in lines:
            yield orjson.dumps(line) + b"\n"


async def _events(first: dict[str, Any], rest: AsyncIterator[dict[str, Any]]) -> AsyncIterator[dict[str, Any]]:
    yield _event(first)
    async with aclosing(rest) as lines:  # type: ignore[type-var]
        async for line in lines:
            yield _event(line)


def _event(line: dict[str, Any]) -> dict[str, Any]:
    event = {"event": line["type"], "data": orjson.dumps(line).decode()}
    if line["type"] == "frame":
        event["id"] = str(line["sequence"])
    return event
