"""The goal pose service's rows of the error table."""

from roam_serving.errors import ErrorKind, ServiceError, StatusCode, by_reason

from roam_goalpose.objects.errors import REASONS, ObjectError

OBJECT_NOT_FOUND = ErrorKind(
    "OBJECT_NOT_FOUND",
    StatusCode.NOT_FOUND,
    404,
    "The server does not have this object (any more)",
    "Upload it again: names are content hashes, so the same file gets the same name.",
)
REFERENCE_POSE_NOT_FOUND = ErrorKind(
    "REFERENCE_POSE_NOT_FOUND",
    StatusCode.NOT_FOUND,
    404,
    "There is no such reference pose",
    "Use a name from ListReferencePoses (GET /v1/reference-poses), create your own again, or name an action.",
)
REFERENCE_POSE_UNFIT = ErrorKind(
    "REFERENCE_POSE_UNFIT",
    StatusCode.INVALID_ARGUMENT,
    422,
    "The pose does not rest on the object",
    "Give the pose in the object's world space (metres, Y up, see Object.object_to_world), where it touches its seat.",
)
JOB_NOT_FOUND = ErrorKind(
    "JOB_NOT_FOUND",
    StatusCode.NOT_FOUND,
    404,
    "There is no such job (any more)",
    "Ask for the goal pose again: what was computed is often still in the cache.",
)
IDEMPOTENCY_KEY_REUSED = ErrorKind(
    "IDEMPOTENCY_KEY_REUSED",
    StatusCode.ALREADY_EXISTS,
    409,
    "The Idempotency-Key stood for another request before",
    "Make a new key for every new request; send the old one only with the same request.",
)

_UPLOAD_REMEDY = "The answer's own remedy says what to change in the file or the request."

# What a file can do wrong, from the room that reads files. Too much of a file is 413, everything else 422.
_TOO_MUCH = {"OBJECT_TOO_LARGE", "OBJECT_TOO_COMPLEX"}


def _upload_kind(reason: str, title: str) -> ErrorKind:
    if reason in _TOO_MUCH:
        return ErrorKind(reason, StatusCode.RESOURCE_EXHAUSTED, 413, title, _UPLOAD_REMEDY)
    return ErrorKind(reason, StatusCode.INVALID_ARGUMENT, 422, title, _UPLOAD_REMEDY)


OBJECT_ERRORS: tuple[ErrorKind, ...] = tuple(_upload_kind(reason, title) for reason, title in REASONS.items())

GOALPOSE_ERRORS: tuple[ErrorKind, ...] = (
    OBJECT_NOT_FOUND,
    REFERENCE_POSE_NOT_FOUND,
    REFERENCE_POSE_UNFIT,
    JOB_NOT_FOUND,
    IDEMPOTENCY_KEY_REUSED,
    *OBJECT_ERRORS,
)

_BY_REASON = by_reason(OBJECT_ERRORS)


def from_object_error(error: ObjectError) -> ServiceError:
    """What the reader of files refused, as a row of the table."""
    return ServiceError(_BY_REASON[error.reason], error.message, field=error.field, remedy=error.remedy)
