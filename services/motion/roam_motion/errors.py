"""The motion service's rows of the error table."""

from roam_serving.errors import ErrorKind, StatusCode

SESSION_NOT_FOUND = ErrorKind(
    "SESSION_NOT_FOUND",
    StatusCode.NOT_FOUND,
    404,
    "There is no such session",
    "Create one; a session without a client is reclaimed after its idle timeout.",
)
SESSION_QUOTA = ErrorKind(
    "SESSION_QUOTA",
    StatusCode.RESOURCE_EXHAUSTED,
    429,
    "As many sessions are alive as the server accepts",
    "Delete sessions that are done, or wait until idle ones are reclaimed.",
)
CONTROL_BUDGET = ErrorKind(
    "CONTROL_BUDGET",
    StatusCode.RESOURCE_EXHAUSTED,
    429,
    "More controls were sent than the server keeps for one session or caller",
    "Send a goal once, not with every frame, and steer at most as often as frames come; go on after Retry-After.",
)
GOAL_UNREACHABLE = ErrorKind(
    "GOAL_UNREACHABLE",
    StatusCode.FAILED_PRECONDITION,
    409,
    "There is no way from the character to the goal",
    "Leave a gap of 25 cm between obstacles, leave out those that may be walked through, or start elsewhere.",
)
SESSION_ELSEWHERE = ErrorKind(
    "SESSION_ELSEWHERE",
    StatusCode.UNAVAILABLE,
    503,
    "Another replica holds the session",
    "Try again; send the requests of one session to one replica, and open its stream there.",
)
STORE_DOWN = ErrorKind(
    "STORE_DOWN",
    StatusCode.UNAVAILABLE,
    503,
    "The store of sessions does not answer",
    "Try again; sessions go on as soon as it is back. /readyz says when.",
)
SEQUENCE_AHEAD = ErrorKind(
    "SEQUENCE_AHEAD",
    StatusCode.OUT_OF_RANGE,
    400,
    "The stream is asked to start after a frame that does not exist yet",
    "Send the sequence of the last frame received, or 0.",
)
OPEN_REQUIRED = ErrorKind(
    "OPEN_REQUIRED",
    StatusCode.FAILED_PRECONDITION,
    409,
    "The first message of a stream must be Open, and only the first",
    "Send AnimateRequest.open first and once.",
)
GOAL_INVALID = ErrorKind(
    "GOAL_INVALID",
    StatusCode.INVALID_ARGUMENT,
    400,
    "The goal is not a pose that this character can take",
    "Send a pose of the session's skeleton and the action SIT or LIE.",
)
MESSAGE_MALFORMED = ErrorKind(
    "MESSAGE_MALFORMED",
    StatusCode.INVALID_ARGUMENT,
    400,
    "The bytes are not the protobuf message that belongs here",
    "Send one AnimateRequest per binary WebSocket message.",
)

MOTION_ERRORS: tuple[ErrorKind, ...] = (
    SESSION_NOT_FOUND,
    SESSION_QUOTA,
    CONTROL_BUDGET,
    GOAL_UNREACHABLE,
    SESSION_ELSEWHERE,
    STORE_DOWN,
    SEQUENCE_AHEAD,
    OPEN_REQUIRED,
    GOAL_INVALID,
    MESSAGE_MALFORMED,
)
