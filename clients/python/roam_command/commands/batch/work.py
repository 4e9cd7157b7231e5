"""One object of a batch, in whatever process an engine runs it: bytes in, a goal pose or a reason out."""

import hashlib
from dataclasses import asdict, dataclass, replace
from functools import cache
from time import perf_counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from roam_character.skeleton import Skeleton
    from roam_goalpose.objects.isolation import IsolatedLoader
    from roam_goalpose.synthesis import Synthesizer


@dataclass(frozen=True)
class Order:
    """What is wanted of every object."""

    reference: str | None
    action: str
    seed: int
    unit: str | None
    up: str | None
    size: float | None = None
    piece: str | None = None
    character: str = ""  # which character, with its map and height: "sha256:…"; "" for the default figure
    body: bytes = b""  # skeleton_pb2.Skeleton of the character

    def record(self) -> dict[str, Any]:
        """What the ledger remembers of it: everything but the body, which the character's mark stands for."""
        found = asdict(self)
        del found["body"]
        return found if self.character else {k: v for k, v in found.items() if k != "character"}


@dataclass(frozen=True)
class Outcome:
    """What became of one object; either the two messages or a reason."""

    object: bytes = b""  # goal_pose_pb2.Object
    goal_pose: bytes = b""  # goal_pose_pb2.GoalPose
    reason: str = ""
    message: str = ""
    seconds: float = 0.0
    content: str = ""  # digest of the file's bytes as they were read

    @property
    def done(self) -> bool:
        """Whether there is a goal pose."""
        return bool(self.goal_pose)


def digest_of(data: bytes) -> str:
    """What a record knows a file by."""
    return f"sha256:{hashlib.sha256(data).hexdigest()}"


def make_goal_pose(data: bytes, format: str, order: Order) -> Outcome:
    """Reads the file in a child process with limits, and fits the pose. Never raises for a bad object or request."""
    return replace(_made(data, format, order), content=digest_of(data))


def _made(data: bytes, format: str, order: Order) -> Outcome:
    from roam_goalpose.api.messages import goal_pose_message, object_message
    from roam_goalpose.objects import ObjectError
    from roam_goalpose.service.queries import StoredObject, goal_pose_of
    from roam_goalpose.synthesis import GoalPoseRequest, RequestError

    try:
        request = GoalPoseRequest(
            reference=order.reference, action=order.action, seed=order.seed, skeleton=_body(order.body)
        )
        loader, synthesizer = _loader(), _synthesizer()
        started = perf_counter()
        shape = loader.load(data, format, unit=order.unit, up=order.up, size=order.size, piece=order.piece)
        result = synthesizer.synthesize(shape, request)
    except ObjectError as error:
        return Outcome(reason=error.reason, message=f"{error.message} {error.remedy}")
    except RequestError as error:
        return Outcome(reason="INVALID_ARGUMENT", message=str(error))
    except Exception as error:  # one object must not end a night's work
        return Outcome(reason="INTERNAL", message=f"{type(error).__name__}: {error}")
    return Outcome(
        object=object_message(StoredObject(shape, format)).SerializeToString(),
        goal_pose=goal_pose_message(goal_pose_of(result, shape, request)).SerializeToString(),
        seconds=perf_counter() - started,
    )


@cache
def _body(message: bytes) -> "Skeleton | None":
    """The skeleton of the character."""
    from roam.v1 import skeleton_pb2
    from roam_goalpose.api.requests import skeleton_from_message

    return skeleton_from_message(skeleton_pb2.Skeleton.FromString(message)) if message else None


@cache
def _synthesizer() -> "Synthesizer":
    """The networks of this process."""
    import torch
    from roam_goalpose.synthesis import Synthesizer

    torch.set_num_threads(1)  # the engine runs as many of these as there are cores
    return Synthesizer.load()


@cache
def _loader() -> "IsolatedLoader":
    """The reader of this process."""
    from roam_goalpose.objects.isolation import IsolatedLoader

    loader = IsolatedLoader()
    loader.warm()
    return loader
