"""The goal pose service's application object: what HTTP and gRPC both translate to."""

import hashlib
import io
import json
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping
from contextlib import aclosing
from dataclasses import asdict, dataclass, replace
from typing import Protocol

import numpy as np
from prometheus_client import CollectorRegistry, Counter, Histogram
from roam.v1 import goal_pose_pb2
from roam_character.skeleton import Skeleton
from roam_serving.cache import RecentCache
from roam_serving.compute import ComputeQueue
from roam_serving.errors import CANCELLED, INVALID_ARGUMENT, PAYLOAD_TOO_LARGE, ServiceError
from roam_serving.skeletons import SKELETON_NOT_FOUND

from roam_goalpose.api.messages import goal_pose_message, object_message, reference_message
from roam_goalpose.api.requests import pose_from_message, skeleton_from_message
from roam_goalpose.api.wanted import Wanted, action_name, wanted_constraints, wanted_weights
from roam_goalpose.errors import OBJECT_NOT_FOUND, REFERENCE_POSE_NOT_FOUND, REFERENCE_POSE_UNFIT, from_object_error
from roam_goalpose.objects import ObjectError, Shape
from roam_goalpose.references.bodies import check_bones
from roam_goalpose.references.pairs import ReferencePair, distance_to_object, own_pair
from roam_goalpose.service.solving import Solving
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.solvers.progress import Cancelled, Progress
from roam_goalpose.synthesis import SOLVERS, GoalPoseRequest, GoalPoseResult, RequestError

TOUCHING = 0.25  # [m] from the hips joint to the surface, at most; shipped references have 0.15
_FIRST_POINTS = 3  # fewer are no surface; the reader of files has the real limit


class SynthesizesPoses(Protocol):
    """`goalpose.synthesis.Synthesizer` as this service uses it."""

    @property
    def references(self) -> Mapping[str, ReferencePair]: ...
    @property
    def field_name(self) -> str: ...
    def synthesize(
        self,
        shape: Shape,
        request: GoalPoseRequest,
        *,
        progress: Callable[[Progress], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> GoalPoseResult: ...


@dataclass(frozen=True)
class _Said:
    """What a sender says about a file; None where nothing."""

    unit: str | None
    up: str | None
    size: float | None
    piece: str | None


class ReadsObjects(Protocol):
    """`roam_goalpose.objects.load_shape`, or the same in a child process."""

    def __call__(
        self,
        data: bytes,
        format: str,
        *,
        unit: str | None = None,
        up: str | None = None,
        size: float | None = None,
        piece: str | None = None,
    ) -> Shape: ...


@dataclass(frozen=True)
class Answer:
    """The end of a synthesis."""

    goal_pose: goal_pose_pb2.GoalPose
    cached: bool


class GoalPoseApplication:
    """Objects by content hash, answers by request hash, a bounded queue of work. All methods run on the event loop."""

    def __init__(
        self,
        synthesizer: SynthesizesPoses,
        load: ReadsObjects,
        settings: GoalPoseSettings,
        registry: CollectorRegistry,
    ) -> None:
        self.settings = settings
        self._load = load
        self._synthesizer = synthesizer
        self._objects = RecentCache[str, tuple[Shape, str]](settings.object_cache)  # name → shape, format
        self._uploads = RecentCache[str, str](4 * settings.object_cache)  # hash of the request → name
        self._own_references = RecentCache[str, ReferencePair](settings.reference_cache)
        self._own_skeletons = RecentCache[str, Skeleton](settings.reference_cache)
        self._answers = RecentCache[str, goal_pose_pb2.GoalPose](settings.result_cache)
        self._solving: dict[str, Solving[Progress, goal_pose_pb2.GoalPose]] = {}
        self._reading = ComputeQueue("upload", limit=settings.upload_limit, registry=registry)
        at_once = max(1, settings.workers * settings.worker_lanes)
        self._computing = ComputeQueue("synthesis", limit=settings.queue_limit, registry=registry, threads=at_once)
        self._hits = Counter("roam_goalpose_cache_hits", "Answers from the cache.", registry=registry)
        self._rejected = Counter("roam_goalpose_uploads_rejected", "Uploads refused.", ("reason",), registry=registry)
        self._seconds = Histogram(
            "roam_goalpose_synthesis_seconds",
            "Time of one synthesis, without waiting.",
            buckets=(0.25, 0.5, 1, 2, 4, 8, 16, 32, 64),
            registry=registry,
        )

    def close(self) -> None:
        """Frees the threads."""
        self._reading.close()
        self._computing.close()

    async def upload(
        self, data: bytes, format: str, unit: str, up: str, *, size: float | None = None, piece: str = ""
    ) -> goal_pose_pb2.Object:
        """Reads a file and keeps the object; the same file again costs nothing. Raises a row of OBJECT_ERRORS.

        `size` is the object's height [m] and goes before the unit; `piece` names one of a file of several.
        """
        if len(data) > self.settings.max_upload_bytes:
            detail = f"{len(data)} bytes; at most {self.settings.max_upload_bytes} are accepted"
            raise ServiceError(PAYLOAD_TOO_LARGE, detail, field="content")
        digest = hashlib.sha256(data)
        digest.update(json.dumps([format, unit, up, size, piece]).encode())
        name = self._uploads.get(digest.hexdigest())
        known = self._objects.get(name) if name else None
        if known is None:
            said = _Said(unit or None, up or None, size, piece or None)
            shape = await self._read(data, format, said)
            known = (shape, format)
            self._objects.put(shape.name, known)
            self._uploads.put(digest.hexdigest(), shape.name)
        return object_message(*known)

    def object(self, name: str) -> goal_pose_pb2.Object:
        """What is known of an uploaded object; OBJECT_NOT_FOUND when it is not here."""
        return object_message(*self._find(name))

    def reference_poses(self, *, include_points: bool) -> list[goal_pose_pb2.ReferencePose]:
        """All reference poses."""
        pairs = self._synthesizer.references.values()
        return [reference_message(pair, include_points=include_points) for pair in pairs]

    def create_reference(self, request: goal_pose_pb2.CreateReferencePoseRequest) -> goal_pose_pb2.ReferencePose:
        """Keeps a pose on an uploaded object as a reference; REFERENCE_POSE_UNFIT when the two do not touch."""
        shape, _ = self._find(request.object)
        skeleton = next((s for s in self._skeletons() if request.pose.skeleton_id in ("", s.id)), None)
        if skeleton is None:
            raise ServiceError(
                SKELETON_NOT_FOUND, f"no skeleton {request.pose.skeleton_id!r}", field="pose.skeleton_id"
            )
        try:
            pose = pose_from_message(request.pose, skeleton)
        except ValueError as error:
            raise ServiceError(INVALID_ARGUMENT, str(error), field="pose") from error
        pair = own_pair(shape, pose, action=action_name(request.action), title=request.title)
        apart = distance_to_object(pair)
        if apart > TOUCHING:
            detail = f"the hips are {apart:.2f} m from the object's surface; at most {TOUCHING} m are plausible"
            raise ServiceError(REFERENCE_POSE_UNFIT, detail, field="pose")
        self._own_references.put(pair.id, pair)
        return reference_message(pair, include_points=False)

    async def check(self, request: goal_pose_pb2.SynthesizeRequest) -> Wanted:
        """The request with every field checked and inline points made an object."""
        wanted = Wanted(
            object=request.object,
            reference=self._reference(request),
            action=self._action(request),
            initial_yaw=request.initial_yaw if request.HasField("initial_yaw") else None,
            restarts=request.restarts,
            seed=request.seed,
            solver=request.solver or "default",
            count=request.count or 1,
            constraints=wanted_constraints(request),
            weights=wanted_weights(request),
            skeleton=self._own_skeleton(request),
        )
        self._check_numbers(wanted)
        self._check_skeleton(request, wanted)
        if request.points:
            if request.object:
                raise ServiceError(INVALID_ARGUMENT, "give object or points, not both", field="points")
            return replace(wanted, object=await self._inline(request.points))
        self._find(wanted.object)
        return wanted

    async def synthesize(self, wanted: Wanted) -> AsyncGenerator[Progress | Answer]:
        """Progress while the optimisation runs, then the answer. Closing the generator stops it."""
        answer = self.cached(wanted)
        if answer is not None:
            yield answer
            return
        key = self._key(wanted)
        solving = self._solving.get(key)
        if solving is None or solving.abandoned:
            solving = self._begin(key, wanted)
        async with aclosing(solving.watch()) as watching:
            async for progress in watching:
                yield progress
        yield Answer(solving.task.result(), cached=False)

    def cached(self, wanted: Wanted) -> Answer | None:
        """The answer, if the same was asked before."""
        answer = self._answers.get(self._key(wanted))
        if answer is None:
            return None
        self._hits.inc()
        return Answer(answer, cached=True)

    def check_room(self) -> None:
        """QUEUE_FULL when one more synthesis would be refused."""
        self._computing.check_room()

    async def answer(self, wanted: Wanted) -> Answer:
        """The end of `synthesize` alone."""
        async with aclosing(self.synthesize(wanted)) as items:
            async for item in items:
                if isinstance(item, Answer):
                    return item
        raise ServiceError(CANCELLED)

    def _begin(self, key: str, wanted: Wanted) -> Solving[Progress, goal_pose_pb2.GoalPose]:
        shape, _ = self._find(wanted.object)
        request = self._request(wanted)

        def start(tell: Callable[[Progress], None], cancelled: Callable[[], bool]) -> Awaitable[goal_pose_pb2.GoalPose]:
            return self._computing.run(lambda: self._solve(shape, request, tell, cancelled))

        solving = Solving(start)
        self._solving[key] = solving
        solving.task.add_done_callback(lambda _: self._finish(key, solving))
        return solving

    def _finish(self, key: str, solving: Solving[Progress, goal_pose_pb2.GoalPose]) -> None:
        if self._solving.get(key) is solving:
            del self._solving[key]
        if not solving.task.cancelled() and solving.task.exception() is None:
            self._answers.put(key, solving.task.result())

    def _solve(
        self,
        shape: Shape,
        request: GoalPoseRequest,
        tell: Callable[[Progress], None],
        cancelled: Callable[[], bool],
    ) -> goal_pose_pb2.GoalPose:
        """In the compute thread."""
        with self._seconds.time():
            try:
                result = self._synthesizer.synthesize(shape, request, progress=tell, cancelled=cancelled)
            except Cancelled:
                raise ServiceError(CANCELLED) from None
            except RequestError as error:
                raise ServiceError(INVALID_ARGUMENT, str(error), field=error.field) from error
        return goal_pose_message(result, shape, request)

    def _key(self, wanted: Wanted) -> str:
        canonical = json.dumps([asdict(wanted), self._synthesizer.field_name], sort_keys=True)
        return hashlib.sha256(canonical.encode()).hexdigest()

    def _find(self, name: str) -> tuple[Shape, str]:
        if not name:
            raise ServiceError(INVALID_ARGUMENT, "object is missing: upload one, or send points", field="object")
        known = self._objects.get(name)
        if known is None:
            raise ServiceError(OBJECT_NOT_FOUND, f"no object {name!r}", field="object")
        return known

    async def _read(self, data: bytes, format: str, said: "_Said") -> Shape:
        try:
            return await self._reading.run(lambda: self._load(data, format, **asdict(said)))
        except ObjectError as error:
            self._rejected.labels(error.reason).inc()
            raise from_object_error(error) from error

    async def _inline(self, data: bytes) -> str:
        count, rest = divmod(len(data), 12)
        if rest or not _FIRST_POINTS <= count <= self.settings.max_inline_points:
            most = self.settings.max_inline_points
            detail = f"{len(data)} bytes; points are float32 [N, 3], N from {_FIRST_POINTS} to {most}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="points")
        file = io.BytesIO()
        np.save(file, np.frombuffer(data, "<f4").reshape(-1, 3))
        return (await self.upload(file.getvalue(), "npy", "m", "y")).name

    def _reference(self, request: goal_pose_pb2.SynthesizeRequest) -> str:
        name = request.reference_pose
        if not name:
            return ""
        reference = name.removeprefix("referencePoses/")
        if reference not in self._synthesizer.references and self._own_references.get(reference) is None:
            known = ", ".join(self._synthesizer.references)
            raise ServiceError(REFERENCE_POSE_NOT_FOUND, f"no reference pose {name!r}: {known}", field="reference_pose")
        return reference

    def _action(self, request: goal_pose_pb2.SynthesizeRequest) -> str:
        return "" if request.reference_pose else action_name(request.action)

    def _check_numbers(self, wanted: Wanted) -> None:
        if wanted.initial_yaw is not None and not abs(wanted.initial_yaw) < 1e4:
            raise ServiceError(INVALID_ARGUMENT, "initial_yaw must be an angle in radians", field="initial_yaw")
        if wanted.restarts > self.settings.max_restarts:
            detail = f"at most {self.settings.max_restarts}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="restarts")
        if wanted.count > self.settings.max_count:
            raise ServiceError(INVALID_ARGUMENT, f"at most {self.settings.max_count}", field="count")
        if wanted.solver == "paper" and (wanted.weights or wanted.constraints.given or wanted.count > 1):
            detail = "solver paper has the published energy and gives one pose: no weights, constraints or count"
            raise ServiceError(INVALID_ARGUMENT, detail, field="solver")
        if wanted.solver not in SOLVERS:
            detail = f"{wanted.solver!r} is not one of {', '.join(SOLVERS)}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="solver")

    def _check_skeleton(self, request: goal_pose_pb2.SynthesizeRequest, wanted: Wanted) -> None:
        if request.skeleton_id and request.skeleton_id not in [skeleton.id for skeleton in self._skeletons()]:
            detail = f"no reference pose of {request.skeleton_id}"
            raise ServiceError(SKELETON_NOT_FOUND, detail, field="skeleton_id")

    def _skeletons(self) -> list[Skeleton]:
        """Those of the shipped reference poses, the default first."""
        return list(dict.fromkeys(pair.pose.skeleton for pair in self._synthesizer.references.values()))

    def _own_skeleton(self, request: goal_pose_pb2.SynthesizeRequest) -> str:
        """Keeps the skeleton that a request brings; its id, or ""."""
        if not request.HasField("skeleton"):
            return ""
        try:
            skeleton = skeleton_from_message(request.skeleton)
            check_bones(skeleton)
        except ValueError as error:
            raise ServiceError(INVALID_ARGUMENT, str(error), field="skeleton") from error
        self._own_skeletons.put(skeleton.id, skeleton)
        return skeleton.id

    def _request(self, wanted: Wanted) -> GoalPoseRequest:
        own = self._own_references.get(wanted.reference)
        return GoalPoseRequest(
            reference=wanted.reference or None,
            action=wanted.action or "sit",
            initial_yaw=wanted.initial_yaw,
            restarts=wanted.restarts,
            seed=wanted.seed,
            solver=wanted.solver,
            count=wanted.count,
            constraints=wanted.constraints,
            weights=wanted.weights,
            pair=own,
            skeleton=self._own_skeletons.get(wanted.skeleton),
        )
