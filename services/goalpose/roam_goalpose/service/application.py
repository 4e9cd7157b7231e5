"""The goal pose service's application object: what HTTP and gRPC both translate to."""

import hashlib
import io
import json
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping
from contextlib import aclosing
from dataclasses import asdict, dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from prometheus_client import CollectorRegistry, Counter, Histogram
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton
from roam_serving.cache import RecentCache
from roam_serving.compute import ComputeQueue
from roam_serving.endpoints.skeletons import SKELETON_NOT_FOUND
from roam_serving.errors import CANCELLED, INVALID_ARGUMENT, PAYLOAD_TOO_LARGE, ServiceError

from roam_goalpose.energy.terms import TERMS
from roam_goalpose.errors import OBJECT_NOT_FOUND, REFERENCE_POSE_NOT_FOUND, REFERENCE_POSE_UNFIT, from_object_error
from roam_goalpose.objects import ObjectError, Shape
from roam_goalpose.references.bodies import check_bones
from roam_goalpose.references.pairs import ACTIONS, ReferencePair, distance_to_object, own_pair
from roam_goalpose.service.queries import Answer, GivenReference, GoalPose, PoseQuery, StoredObject, goal_pose_of
from roam_goalpose.service.solving import Solving
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.solvers.progress import Cancelled, Progress
from roam_goalpose.synthesis import SOLVERS, GoalPoseRequest, GoalPoseResult, RequestError

TOUCHING = 0.25  # [m] from the hips joint to the surface, at most; shipped references have 0.15
HEAVIEST = 1e6  # of any energy term
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
        self._objects = RecentCache[str, StoredObject](settings.object_cache)  # by name
        self._uploads = RecentCache[str, str](4 * settings.object_cache)  # hash of the request → name
        self._own_references = RecentCache[str, ReferencePair](settings.reference_cache)
        self._answers = RecentCache[str, GoalPose](settings.result_cache)
        self._solving: dict[str, Solving[Progress, GoalPose]] = {}
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
    ) -> StoredObject:
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
            known = StoredObject(await self._read(data, format, said), format)
            self._objects.put(known.shape.name, known)
            self._uploads.put(digest.hexdigest(), known.shape.name)
        return known

    def object(self, name: str) -> StoredObject:
        """An uploaded object; OBJECT_NOT_FOUND when it is not here."""
        if not name:
            raise ServiceError(INVALID_ARGUMENT, "object is missing: upload one, or send points", field="object")
        known = self._objects.get(name)
        if known is None:
            raise ServiceError(OBJECT_NOT_FOUND, f"no object {name!r}", field="object")
        return known

    def reference_poses(self) -> list[ReferencePair]:
        """All reference poses."""
        return list(self._synthesizer.references.values())

    def create_reference(self, given: GivenReference) -> ReferencePair:
        """Keeps a pose on an uploaded object as a reference; REFERENCE_POSE_UNFIT when the two do not touch."""
        shape = self.object(given.object).shape
        skeleton = next((s for s in self._skeletons() if given.skeleton_id in ("", s.id)), None)
        if skeleton is None:
            raise ServiceError(SKELETON_NOT_FOUND, f"no skeleton {given.skeleton_id!r}", field="pose.skeleton_id")
        try:
            pose = Pose(skeleton, given.root_position, given.rotations)
        except ValueError as error:
            raise ServiceError(INVALID_ARGUMENT, str(error), field="pose") from error
        pair = own_pair(shape, pose, action=given.action, title=given.title)
        apart = distance_to_object(pair)
        if apart > TOUCHING:
            detail = f"the hips are {apart:.2f} m from the object's surface; at most {TOUCHING} m are plausible"
            raise ServiceError(REFERENCE_POSE_UNFIT, detail, field="pose")
        self._own_references.put(pair.id, pair)
        return pair

    async def check(self, query: PoseQuery) -> PoseQuery:
        """The query with every field checked and inline points made an object."""
        self._check_reference(query)
        self._check_weights(query)
        self._check_numbers(query)
        self._check_skeleton(query)
        if query.points is not None:
            if query.object:
                raise ServiceError(INVALID_ARGUMENT, "give object or points, not both", field="points")
            return replace(query, object=await self._inline(query.points), points=None)
        self.object(query.object)
        return query

    async def synthesize(self, query: PoseQuery) -> AsyncGenerator[Progress | Answer]:
        """Progress while the optimisation runs, then the answer. Closing the generator stops it."""
        answer = self.cached(query)
        if answer is not None:
            yield answer
            return
        key = self._key(query)
        solving = self._solving.get(key)
        if solving is None or solving.abandoned:
            solving = self._begin(key, query)
        async with aclosing(solving.watch()) as watching:
            async for progress in watching:
                yield progress
        yield Answer(solving.task.result(), cached=False)

    def cached(self, query: PoseQuery) -> Answer | None:
        """The answer, if the same was asked before."""
        answer = self._answers.get(self._key(query))
        if answer is None:
            return None
        self._hits.inc()
        return Answer(answer, cached=True)

    def check_room(self) -> None:
        """QUEUE_FULL when one more synthesis would be refused."""
        self._computing.check_room()

    async def answer(self, query: PoseQuery) -> Answer:
        """The end of `synthesize` alone."""
        async with aclosing(self.synthesize(query)) as items:
            async for item in items:
                if isinstance(item, Answer):
                    return item
        raise ServiceError(CANCELLED)

    def _begin(self, key: str, query: PoseQuery) -> Solving[Progress, GoalPose]:
        shape = self.object(query.object).shape
        request = self._request(query)

        def start(tell: Callable[[Progress], None], cancelled: Callable[[], bool]) -> Awaitable[GoalPose]:
            return self._computing.run(lambda: self._solve(shape, request, tell, cancelled))

        solving = Solving(start)
        self._solving[key] = solving
        solving.task.add_done_callback(lambda _: self._finish(key, solving))
        return solving

    def _finish(self, key: str, solving: Solving[Progress, GoalPose]) -> None:
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
    ) -> GoalPose:
        """In the compute thread."""
        with self._seconds.time():
            try:
                result = self._synthesizer.synthesize(shape, request, progress=tell, cancelled=cancelled)
            except Cancelled:
                raise ServiceError(CANCELLED) from None
            except RequestError as error:
                raise ServiceError(INVALID_ARGUMENT, str(error), field=error.field) from error
        return goal_pose_of(result, shape, request)

    def _key(self, query: PoseQuery) -> str:
        canonical = json.dumps([query.key, self._synthesizer.field_name], sort_keys=True)
        return hashlib.sha256(canonical.encode()).hexdigest()

    async def _read(self, data: bytes, format: str, said: "_Said") -> Shape:
        try:
            return await self._reading.run(lambda: self._load(data, format, **asdict(said)))
        except ObjectError as error:
            self._rejected.labels(error.reason).inc()
            raise from_object_error(error) from error

    async def _inline(self, points: NDArray[np.float32]) -> str:
        most = self.settings.max_inline_points
        if not _FIRST_POINTS <= len(points) <= most:
            detail = f"{len(points)} points; from {_FIRST_POINTS} to {most}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="points")
        file = io.BytesIO()
        np.save(file, points)
        return (await self.upload(file.getvalue(), "npy", "m", "y")).shape.name

    def _check_reference(self, query: PoseQuery) -> None:
        name, known = query.reference, self._synthesizer.references
        if name and name not in known and self._own_references.get(name) is None:
            detail = f"no reference pose {name!r}: {', '.join(known)}"
            raise ServiceError(REFERENCE_POSE_NOT_FOUND, detail, field="reference_pose")
        if not name and query.action not in ACTIONS:
            detail = f"name a reference_pose, or an action of {', '.join(ACTIONS)}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="action")

    @staticmethod
    def _check_weights(query: PoseQuery) -> None:
        for name, weight in query.weights:
            if name not in TERMS or not 0.0 <= weight <= HEAVIEST:
                detail = f"{name} = {weight}: a weight is from 0 to {HEAVIEST:.0e}, of one of {', '.join(TERMS)}"
                raise ServiceError(INVALID_ARGUMENT, detail, field="weights")

    def _check_numbers(self, query: PoseQuery) -> None:
        if query.initial_yaw is not None and not abs(query.initial_yaw) < 1e4:
            raise ServiceError(INVALID_ARGUMENT, "initial_yaw must be an angle in radians", field="initial_yaw")
        if query.restarts > self.settings.max_restarts:
            detail = f"at most {self.settings.max_restarts}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="restarts")
        if query.count > self.settings.max_count:
            raise ServiceError(INVALID_ARGUMENT, f"at most {self.settings.max_count}", field="count")
        if query.solver == "paper" and (query.weights or query.constraints.given or query.count > 1):
            detail = "solver paper has the published energy and gives one pose: no weights, constraints or count"
            raise ServiceError(INVALID_ARGUMENT, detail, field="solver")
        if query.solver not in SOLVERS:
            detail = f"{query.solver!r} is not one of {', '.join(SOLVERS)}"
            raise ServiceError(INVALID_ARGUMENT, detail, field="solver")

    def _check_skeleton(self, query: PoseQuery) -> None:
        if query.skeleton is not None:
            try:
                check_bones(query.skeleton)
            except ValueError as error:
                raise ServiceError(INVALID_ARGUMENT, str(error), field="skeleton") from error
        if query.skeleton_id and query.skeleton_id not in [skeleton.id for skeleton in self._skeletons()]:
            detail = f"no reference pose of {query.skeleton_id}"
            raise ServiceError(SKELETON_NOT_FOUND, detail, field="skeleton_id")

    def _skeletons(self) -> list[Skeleton]:
        """Those of the shipped reference poses, the default first."""
        return list(dict.fromkeys(pair.pose.skeleton for pair in self._synthesizer.references.values()))

    def _request(self, query: PoseQuery) -> GoalPoseRequest:
        own = self._own_references.get(query.reference)
        return GoalPoseRequest(
            reference=query.reference or None,
            action=query.action or "sit",
            initial_yaw=query.initial_yaw,
            restarts=query.restarts,
            seed=query.seed,
            solver=query.solver,
            count=query.count,
            constraints=query.constraints,
            weights=query.weights,
            pair=own,
            skeleton=query.skeleton,
        )
