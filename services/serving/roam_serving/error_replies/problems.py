"""Errors on HTTP: RFC 9457 `application/problem+json`."""

import math
from collections.abc import Sequence
from http.client import responses
from typing import Any

import orjson
import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response

from roam_serving.errors import (
    INTERNAL,
    INVALID_ARGUMENT,
    METHOD_NOT_ALLOWED,
    PAYLOAD_TOO_LARGE,
    ROUTE_NOT_FOUND,
    UNSUPPORTED_MEDIA_TYPE,
    ServiceError,
)

MEDIA_TYPE = "application/problem+json"

_BY_STATUS = {
    kind.http_status: kind
    for kind in (INVALID_ARGUMENT, ROUTE_NOT_FOUND, METHOD_NOT_ALLOWED, UNSUPPORTED_MEDIA_TYPE, PAYLOAD_TOO_LARGE)
}


def problem(error: ServiceError, violations: Sequence[dict[str, str]] = ()) -> dict[str, Any]:
    """The RFC 9457 object of an error; `errors` lists the fields at fault."""
    errors = list(violations)
    if error.field and not errors:
        errors = [{"field": error.field, "detail": error.detail}]
    body: dict[str, Any] = {
        "type": f"urn:roam:error:{error.kind.reason}",
        "title": error.kind.title,
        "status": error.kind.http_status,
        "detail": error.detail,
        "reason": error.kind.reason,
        "remedy": error.remedy,
    }
    if errors:
        body["errors"] = errors
    if error.retry_after is not None:
        body["retry_after"] = error.retry_after
    if request_id := structlog.contextvars.get_contextvars().get("request_id"):
        body["instance"] = f"urn:roam:request:{request_id}"
    return body


def problem_response(error: ServiceError, violations: Sequence[dict[str, str]] = ()) -> Response:
    """The error as an HTTP response."""
    headers = {}
    if error.kind.http_status == 401:
        headers["WWW-Authenticate"] = "Bearer"
    if error.retry_after is not None:
        headers["Retry-After"] = str(math.ceil(error.retry_after))
    content = orjson.dumps(problem(error, violations))
    return Response(content, status_code=error.kind.http_status, media_type=MEDIA_TYPE, headers=headers)


def from_http_exception(error: HTTPException) -> ServiceError:
    """The table's row for what the web framework itself refuses (unknown address, wrong method, …)."""
    kind = _BY_STATUS.get(error.status_code)
    if kind is None:
        kind = INTERNAL if error.status_code >= 500 else INVALID_ARGUMENT
    said_something = error.detail != responses.get(error.status_code)
    return ServiceError(kind, str(error.detail) if said_something else "")


def _field(location: Sequence[Any]) -> str:
    """`("body", "points", 3)` → `points.3`."""
    return ".".join(str(part) for part in location[1:]) or str(location[0])


async def _on_service_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, ServiceError)
    return problem_response(error)


async def _on_http_exception(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    response = problem_response(from_http_exception(error))
    response.headers.update(error.headers or {})
    return response


async def _on_validation_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    violations = [{"field": _field(item["loc"]), "detail": item["msg"]} for item in error.errors()]
    first = violations[0]
    detail = f"{first['field']}: {first['detail']}"
    return problem_response(ServiceError(INVALID_ARGUMENT, detail, field=first["field"]), violations)


def add_problem_handlers(app: FastAPI) -> None:
    """Makes every error of the application a problem document."""
    app.add_exception_handler(ServiceError, _on_service_error)
    app.add_exception_handler(HTTPException, _on_http_exception)
    app.add_exception_handler(RequestValidationError, _on_validation_error)


PROBLEM_RESPONSES: dict[int | str, dict[str, Any]] = {
    "4XX": {
        "description": "Refused: see `reason` and `remedy`",
        "content": {
            MEDIA_TYPE: {
                "schema": {
                    "type": "object",
                    "required": ["type", "title", "status", "detail", "reason", "remedy"],
                    "properties": {
                        "type": {"type": "string", "description": "urn:roam:error:REASON"},
                        "title": {"type": "string"},
                        "status": {"type": "integer"},
                        "detail": {"type": "string"},
                        "reason": {"type": "string", "description": "a reason of docs/reference/errors.md"},
                        "remedy": {"type": "string", "description": "what to do"},
                        "errors": {"type": "array", "items": {"type": "object"}, "description": "fields at fault"},
                        "instance": {"type": "string", "description": "urn:roam:request:ID, as in the server's log"},
                        "retry_after": {"type": "number", "description": "seconds"},
                    },
                }
            }
        },
    }
}
