"""Errors on gRPC: google.rpc.Status with ErrorInfo, BadRequest, RetryInfo and RequestInfo."""

import structlog
from google.protobuf import any_pb2, duration_pb2
from google.protobuf.message import Message
from google.rpc import error_details_pb2, status_pb2

from roam_serving.errors import ServiceError

DOMAIN = "roam"


def _pack(message: Message) -> any_pb2.Any:
    packed = any_pb2.Any()
    packed.Pack(message)
    return packed


def rpc_status(error: ServiceError) -> status_pb2.Status:
    """The rich status of an error; ErrorInfo.reason is what a client branches on."""
    info = error_details_pb2.ErrorInfo(
        reason=error.kind.reason, domain=DOMAIN, metadata={"title": error.kind.title, "remedy": error.remedy}
    )
    details = [_pack(info)]
    if error.field:
        violation = error_details_pb2.BadRequest.FieldViolation(field=error.field, description=error.detail)
        details.append(_pack(error_details_pb2.BadRequest(field_violations=[violation])))
    if error.retry_after is not None:
        delay = duration_pb2.Duration()
        delay.FromMilliseconds(round(error.retry_after * 1000))
        details.append(_pack(error_details_pb2.RetryInfo(retry_delay=delay)))
    if request_id := structlog.contextvars.get_contextvars().get("request_id"):
        details.append(_pack(error_details_pb2.RequestInfo(request_id=request_id)))
    code = error.kind.grpc_code.value[0]
    return status_pb2.Status(code=code, message=error.detail, details=details)
