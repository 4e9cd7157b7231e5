"""Structured logs: one JSON object a line on stderr, with the request id of whatever caused it."""

import logging
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast
from uuid import uuid4

import structlog

from roam_serving.settings import ServerSettings

_REQUEST_ID = re.compile(r"[A-Za-z0-9._:-]{1,128}")
_SHARED: list[Any] = [
    structlog.contextvars.merge_contextvars,
    structlog.stdlib.add_logger_name,
    structlog.stdlib.add_log_level,
    structlog.processors.TimeStamper(fmt="iso", utc=True),
]


def get_log(name: str) -> structlog.stdlib.BoundLogger:
    """A structured logger over `logging.getLogger(name)`; silent below WARNING until someone configures logging."""
    logger = structlog.wrap_logger(
        logging.getLogger(name),
        processors=[
            structlog.stdlib.filter_by_level,
            *_SHARED,
            structlog.processors.StackInfoRenderer(),
            structlog.processors.format_exc_info,
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        wrapper_class=structlog.stdlib.BoundLogger,
    )
    return cast(structlog.stdlib.BoundLogger, logger)


def configure_logs(settings: ServerSettings) -> None:
    """Sends the process's logs to stderr; called by `python -m …`, never by an embedded server."""
    renderer: Any = structlog.processors.JSONRenderer()
    if settings.log_format == "console":
        renderer = structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty())
    formatter = structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=_SHARED,
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, renderer],
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(formatter)
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(settings.log_level.upper())


def choose_request_id(offered: str | None) -> str:
    """The caller's request id when it is a sane one, else a new one."""
    if offered and _REQUEST_ID.fullmatch(offered):
        return offered
    return uuid4().hex


def remember(**values: str) -> None:
    """Adds facts, such as the session, to every later log line of the request that is being answered."""
    structlog.contextvars.bind_contextvars(**values)


@contextmanager
def request_scope(request_id: str) -> Iterator[None]:
    """Binds the request id to every log line and error inside; what was remembered inside is forgotten after."""
    with structlog.contextvars.bound_contextvars(request_id=request_id):
        before = structlog.contextvars.get_contextvars()
        try:
            yield
        finally:
            structlog.contextvars.clear_contextvars()
            structlog.contextvars.bind_contextvars(**before)
