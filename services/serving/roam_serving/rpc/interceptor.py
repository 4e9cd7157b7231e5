"""The gRPC side's counterpart of the HTTP middleware: request ids, errors as rich statuses, metrics, logs."""

from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import aclosing, contextmanager
from time import monotonic
from typing import Any

import grpc
from google.protobuf.message import DecodeError
from grpc_status import rpc_status as rich_status

from roam_serving.access import Access
from roam_serving.error_replies.statuses import rpc_status
from roam_serving.errors import INTERNAL, INVALID_ARGUMENT, ServiceError
from roam_serving.monitoring.logs import choose_request_id, get_log, request_scope
from roam_serving.monitoring.metrics import Metrics
from roam_serving.monitoring.tracing import Tracing

log = get_log("serving.grpc")

_QUIET = ("/grpc.health.", "/grpc.reflection.")


class RequestInterceptor(grpc.aio.ServerInterceptor):  # type: ignore[misc]  # grpc has no types
    """Wraps every method; a ServiceError becomes its status, anything else INTERNAL with the trace in the log."""

    def __init__(self, metrics: Metrics, access: Access, tracing: Tracing) -> None:
        self._metrics = metrics
        self._tracing = tracing
        self._access = access

    async def intercept_service(
        self, continuation: Callable[[Any], Awaitable[Any]], details: grpc.HandlerCallDetails
    ) -> Any:
        """The method's handler with this class's wrapping around its behaviour."""
        handler = await continuation(details)
        if handler is None:
            return None
        method = details.method
        decode = handler.request_deserializer and _decoder(handler.request_deserializer)
        if handler.response_streaming:
            make = grpc.stream_stream_rpc_method_handler if handler.request_streaming else _unary_stream
            behaviour = handler.stream_stream if handler.request_streaming else handler.unary_stream
            wrapped: Any = self._streaming(method, behaviour)
        else:
            make = grpc.stream_unary_rpc_method_handler if handler.request_streaming else _unary_unary
            behaviour = handler.stream_unary if handler.request_streaming else handler.unary_unary
            wrapped = self._single(method, behaviour)
        return make(
            wrapped,
            request_deserializer=decode,
            response_serializer=handler.response_serializer,
        )

    def _single(self, method: str, behaviour: Callable[..., Awaitable[Any]]) -> Callable[..., Awaitable[Any]]:
        async def wrapped(request: Any, context: Any) -> Any:
            with self._scope(method, context):
                try:
                    self._admit(method, context)
                    return await behaviour(_decoded(request), context)
                except Exception as error:
                    await _abort(context, error)

        return wrapped

    def _streaming(self, method: str, behaviour: Callable[..., Any]) -> Callable[..., AsyncIterator[Any]]:
        async def wrapped(request: Any, context: Any) -> AsyncIterator[Any]:
            with self._scope(method, context):
                try:
                    self._admit(method, context)
                    answer = behaviour(_decoded(request), context)
                    if not hasattr(answer, "__aiter__"):  # writes through the context instead of yielding
                        await answer
                        return
                    async with aclosing(answer):
                        async for message in answer:
                            yield message
                except Exception as error:
                    await _abort(context, error)

        return wrapped

    def _admit(self, method: str, context: Any) -> None:
        self._access.admit_call(method, context.invocation_metadata() or (), context.peer())

    @contextmanager
    def _scope(self, method: str, context: Any) -> Iterator[None]:
        start = monotonic()
        headers = {key: str(value) for key, value in context.invocation_metadata() or ()}
        request_id = choose_request_id(headers.get("x-request-id"))
        with (
            request_scope(request_id),
            self._metrics.in_flight.labels("grpc").track_inprogress(),
            self._tracing.span(method.removeprefix("/"), headers) as span,
        ):
            try:
                yield
            finally:
                seconds = monotonic() - start
                code = _code_name(context)
                self._metrics.requests.labels("grpc", method, code).inc()
                self._metrics.request_seconds.labels("grpc", method).observe(seconds)
                level = log.debug if method.startswith(_QUIET) else log.info
                level("request", method=method, code=code, seconds=round(seconds, 4))
                if span is not None:
                    span.set_attribute("rpc.grpc.status_code", code)
                    span.set_attribute("roam.request_id", request_id)


class _Undecodable:
    """Stands for bytes that are no message of the method's type; gRPC itself would answer UNKNOWN without a reason."""


def _decoder(decode: Callable[[bytes], Any]) -> Callable[[bytes], Any]:
    def decoded(data: bytes) -> Any:
        try:
            return decode(data)
        except DecodeError:
            return _Undecodable()

    return decoded


def _decoded(request: Any) -> Any:
    """The request, or the iterator of requests, with INVALID_ARGUMENT raised where one could not be decoded."""
    if hasattr(request, "__aiter__"):
        return _each_decoded(request)
    if isinstance(request, _Undecodable):
        remedy = "Encode the message with the code generated from this version's .proto files (proto/roam/v1)."
        raise ServiceError(INVALID_ARGUMENT, "the bytes are not the message that this method takes", remedy=remedy)
    return request


async def _each_decoded(requests: AsyncIterator[Any]) -> AsyncIterator[Any]:
    async for request in requests:
        yield _decoded(request)


_unary_unary = grpc.unary_unary_rpc_method_handler
_unary_stream = grpc.unary_stream_rpc_method_handler


def _code_name(context: Any) -> str:
    if context.cancelled():
        return "CANCELLED"
    code = context.code() or 0
    for status in grpc.StatusCode:
        if code in (status, status.value[0]):
            return status.name
    return str(code)


async def _abort(context: Any, error: Exception) -> None:
    """Ends the call with the error's rich status; re-raises grpc's own abort."""
    if isinstance(error, grpc.aio.AbortError | grpc.aio.BaseError):
        raise error
    if not isinstance(error, ServiceError):
        log.error("request failed", exc_info=error)
        error = ServiceError(INTERNAL, type(error).__name__)
    await context.abort_with_status(rich_status.to_status(rpc_status(error)))
