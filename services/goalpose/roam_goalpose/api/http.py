"""The goal pose service over HTTP: a thin translation of GoalPoseApplication."""

import asyncio
import io
import zipfile
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing
from email.message import Message
from pathlib import PurePath
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Header, Query, Request, Response
from pydantic import BaseModel, ValidationError
from roam_serving.error_replies.problems import problem
from roam_serving.errors import CANCELLED, INTERNAL, INVALID_ARGUMENT, ServiceError
from roam_serving.monitoring.logs import get_log
from sse_starlette import EventSourceResponse
from starlette.datastructures import FormData, UploadFile

from roam_goalpose.api.messages import goal_pose_message, object_message, progress_message, reference_message
from roam_goalpose.api.request_schemas import CreateReferencePoseJson, SynthesizeJson
from roam_goalpose.api.requests import query_from_message, reference_from_message
from roam_goalpose.api.schemas import (
    GoalPoseJson,
    JobJson,
    ObjectJson,
    ProgressJson,
    ReferencePoseJson,
    ReferencePosesJson,
)
from roam_goalpose.errors import from_object_error
from roam_goalpose.objects import FORMATS, ObjectError, format_of
from roam_goalpose.objects.readers.registry import media_types, sniff
from roam_goalpose.service.application import GoalPoseApplication
from roam_goalpose.service.jobs import Job, Jobs, JobState
from roam_goalpose.service.queries import Answer, PoseQuery

log = get_log("roam_goalpose.api.http")

_BINARY = {"schema": {"type": "string", "format": "binary"}}
_UPLOAD_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            **dict.fromkeys((*media_types(), "application/octet-stream"), _BINARY),
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["file"],
                    "properties": {
                        "file": {"type": "string", "format": "binary"},
                        "format": {"type": "string"},
                        "unit": {"type": "string"},
                        "up": {"type": "string"},
                        "size": {"type": "number"},
                        "piece": {"type": "string"},
                    },
                }
            },
        },
    }
}


class Said(BaseModel):
    """What a sender says about a file; empty where nothing."""

    format: str = ""
    unit: str = ""
    up: str = ""
    size: float | None = None
    piece: str = ""


class Upload(Said):
    """A file and what was said about it."""

    data: bytes
    file_name: str = ""

    def chosen_format(self, media_type: str) -> str:
        """The format given, else by file name, media type or first bytes; a ServiceError when none of them says."""
        if self.format:
            return self.format
        if media_type in media_types():
            return media_types()[media_type]
        if PurePath(self.file_name).suffix:
            try:
                return format_of(self.file_name)
            except ObjectError as error:
                raise from_object_error(error) from error
        if found := sniff(self.data):
            return found
        detail = f"format is missing: add ?format=, one of {', '.join(FORMATS)}"
        raise ServiceError(INVALID_ARGUMENT, detail, field="format")


def goalpose_router(application: Callable[[], GoalPoseApplication], jobs: Callable[[], Jobs]) -> APIRouter:
    """The routes under /v1; `application` and `jobs` are called per request."""
    router = APIRouter(prefix="/v1", tags=["goalpose"])

    @router.post("/objects", status_code=201, summary="Upload an object file", openapi_extra=_UPLOAD_BODY)
    async def upload_object(
        request: Request,
        format: Annotated[str, Query(description=f"one of {', '.join(FORMATS)}; else by name or type")] = "",
        unit: Annotated[str, Query(description="m, cm, mm, in or ft; empty: detect")] = "",
        up: Annotated[str, Query(description="x, y, z, -x, -y or -z; empty: detect")] = "",
        size: Annotated[float | None, Query(description="height of the object [m]; goes before the unit")] = None,
        piece: Annotated[str, Query(description="name or index in a file of several; empty: the best seat")] = "",
    ) -> ObjectJson:
        upload = await _read_upload(request, Said(format=format, unit=unit, up=up, size=size, piece=piece))
        chosen = upload.chosen_format(_media_type(request))
        stored = await application().upload(
            upload.data, chosen, upload.unit, upload.up, size=upload.size, piece=upload.piece
        )
        return ObjectJson.of(object_message(stored))

    @router.get("/objects/{object}", summary="Read what is known of an object")
    async def get_object(object: str) -> ObjectJson:
        return ObjectJson.of(object_message(application().object(f"objects/{object}")))

    @router.get("/reference-poses", summary="List the poses that can be adapted")
    async def list_reference_poses(
        include_points: Annotated[bool, Query(description="also send the reference objects' surfaces")] = False,
    ) -> ReferencePosesJson:
        messages = [reference_message(pair, include_points=include_points) for pair in application().reference_poses()]
        return ReferencePosesJson(reference_poses=[ReferencePoseJson.of(message) for message in messages])

    @router.post("/reference-poses", status_code=201, summary="Put a reference pose of your own on an uploaded object")
    async def create_reference_pose(body: CreateReferencePoseJson) -> ReferencePoseJson:
        pair = application().create_reference(reference_from_message(body.message()))
        return ReferencePoseJson.of(reference_message(pair, include_points=False))

    _add_goal_poses(router, application, jobs)
    _add_jobs(router, jobs)
    return router


def _add_goal_poses(
    router: APIRouter, application: Callable[[], GoalPoseApplication], jobs: Callable[[], Jobs]
) -> None:
    @router.post(
        "/goal-poses",
        summary="Synthesize a goal pose; with Accept: text/event-stream progress streams while it runs, "
        "with Prefer: respond-async it runs as a job",
        response_model=GoalPoseJson,
        responses={
            200: {"content": {"text/event-stream": {}}},
            202: {"model": JobJson, "description": "A job; ask its Location again"},
        },
    )
    async def synthesize(
        body: SynthesizeJson,
        request: Request,
        response: Response,
        accept: Annotated[str, Header()] = "",
        prefer: Annotated[str, Header(description="respond-async: answer at once with a job")] = "",
        idempotency_key: Annotated[str, Header(max_length=128, description="makes sending again safe")] = "",
    ) -> GoalPoseJson | Response:
        service = application()
        query = await service.check(query_from_message(body.message()))
        if "respond-async" in prefer and service.cached(query) is None:
            return _job_response(jobs().start(query, idempotency_key), 202)
        jobs().use_key(query, idempotency_key)
        if "text/event-stream" in accept:
            return EventSourceResponse(_events(service, query))
        answer = await _answer(service, query, request)
        response.headers["X-Roam-Cache"] = "hit" if answer.cached else "miss"
        return GoalPoseJson.of(goal_pose_message(answer.goal_pose))


def _add_jobs(router: APIRouter, jobs: Callable[[], Jobs]) -> None:
    @router.get("/jobs/{job}", summary="How far a job is, and its goal pose when it has one", response_model=JobJson)
    async def get_job(job: str) -> Response:
        return _job_response(jobs().get(f"jobs/{job}"), 200)

    @router.delete("/jobs/{job}", status_code=204, summary="Stop a job and forget it")
    async def delete_job(job: str) -> Response:
        jobs().delete(f"jobs/{job}")
        return Response(status_code=204)


def _job_response(job: Job, status: int) -> Response:
    headers = {"Location": f"/v1/{job.name}"}
    if job.state is JobState.RUNNING:
        headers["Retry-After"] = "1"
    content = JobJson.of(job).model_dump_json()
    return Response(content, status_code=status, media_type="application/json", headers=headers)


async def _answer(service: GoalPoseApplication, query: PoseQuery, request: Request) -> Answer:
    """The answer, unless the caller hangs up first: then the optimisation stops."""
    answering = asyncio.ensure_future(service.answer(query))
    leaving = asyncio.ensure_future(_hung_up(request))
    try:
        await asyncio.wait({answering, leaving}, return_when=asyncio.FIRST_COMPLETED)
        if not answering.done():
            raise ServiceError(CANCELLED, "the connection was closed")
        return answering.result()
    finally:
        answering.cancel()
        leaving.cancel()


async def _hung_up(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass


async def _events(service: GoalPoseApplication, query: PoseQuery) -> AsyncIterator[dict[str, str]]:
    """Server-sent events: `progress` …, then `goal_pose`, or `error` with a problem document."""
    try:
        async with aclosing(service.synthesize(query)) as items:
            async for item in items:
                if isinstance(item, Answer):
                    yield {
                        "event": "goal_pose",
                        "data": GoalPoseJson.of(goal_pose_message(item.goal_pose)).model_dump_json(),
                    }
                else:
                    yield {"event": "progress", "data": ProgressJson.of(progress_message(item)).model_dump_json()}
    except Exception as error:
        if not isinstance(error, ServiceError):
            log.error("synthesis failed", exc_info=error)
            error = ServiceError(INTERNAL, type(error).__name__)
        yield {"event": "error", "data": orjson.dumps(problem(error)).decode()}


def _media_type(request: Request) -> str:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def _named_in(request: Request) -> str:
    """File name of a Content-Disposition header."""
    parsed = Message()
    parsed["content-disposition"] = request.headers.get("content-disposition", "")
    return parsed.get_filename() or ""


async def _read_upload(request: Request, said: Said) -> Upload:
    """The file of a raw or multipart body; form fields count where the query says nothing."""
    if _media_type(request) != "multipart/form-data":
        data = await request.body()
        return Upload(data=data, file_name=_named_in(request), **said.model_dump())
    async with request.form() as form:
        files = [file for name in ("file", "files") for file in form.getlist(name) if isinstance(file, UploadFile)]
        if not files:
            raise ServiceError(INVALID_ARGUMENT, "the form needs a file in the field `file`", field="file")
        said = _said_in(form, said)
        if len(files) > 1:  # a `.gltf` and its buffers, an OBJ and its materials: as if they came in one ZIP
            said.format = "zip"
            return Upload(data=await _packed(files), file_name="upload.zip", **said.model_dump())
        return Upload(data=await files[0].read(), file_name=files[0].filename or "", **said.model_dump())


def _said_in(form: FormData, said: Said) -> Said:
    """What the query says, and the form where the query says nothing."""
    fields = {name: str(form[name]) for name in Said.model_fields if isinstance(form.get(name), str) and form[name]}
    queried = {name: value for name, value in said.model_dump().items() if value not in ("", None)}
    try:
        return Said.model_validate({**fields, **queried})
    except ValidationError as error:
        raise ServiceError(INVALID_ARGUMENT, "size is a number of metres", field="size") from error


async def _packed(files: list[UploadFile]) -> bytes:
    """Several files as one uncompressed ZIP."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for number, file in enumerate(files):
            archive.writestr(file.filename or f"file {number}", await file.read())
    return packed.getvalue()
