"""A checked request for a goal pose, and what parts of the protocol's requests become in it."""

from dataclasses import dataclass

from roam.v1 import goal_pose_pb2
from roam_serving.errors import INVALID_ARGUMENT, ServiceError

from roam_goalpose.api.messages import ACTIONS
from roam_goalpose.api.requests import constraints_from_message
from roam_goalpose.energy.constraints import NONE, Constraints
from roam_goalpose.energy.terms import TERMS

HEAVIEST = 1e6  # of any energy term


@dataclass(frozen=True)
class Wanted:
    """A checked request: what, besides the weights, decides the answer."""

    object: str
    reference: str  # id, or "" with an action
    action: str
    initial_yaw: float | None
    restarts: int
    seed: int
    solver: str
    count: int = 1
    constraints: Constraints = NONE
    weights: tuple[tuple[str, float], ...] = ()
    skeleton: str = ""  # id of the caller's own, or "" for that of the reference poses


def action_name(action: int) -> str:
    """The action of a request; INVALID_ARGUMENT when it is not sitting or lying."""
    for name, number in ACTIONS.items():
        if number == action:
            return name
    raise ServiceError(INVALID_ARGUMENT, "name a reference_pose, or the action SIT or LIE", field="action")


def wanted_constraints(request: goal_pose_pb2.SynthesizeRequest) -> Constraints:
    """Where to sit, face and put the hands; INVALID_ARGUMENT when that cannot be meant."""
    try:
        return constraints_from_message(request.constraints)
    except ValueError as error:
        raise ServiceError(INVALID_ARGUMENT, str(error), field="constraints") from error


def wanted_weights(request: goal_pose_pb2.SynthesizeRequest) -> tuple[tuple[str, float], ...]:
    """Energy terms that weigh otherwise, by name; INVALID_ARGUMENT for terms or weights that there are not."""
    for name, weight in request.weights.items():
        if name not in TERMS or not 0.0 <= weight <= HEAVIEST:
            detail = f"{name} = {weight}: a weight is from 0 to {HEAVIEST:.0e}, of one of {', '.join(TERMS)}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="weights")
    return tuple(sorted(request.weights.items()))
