"""Goal poses that nobody waits for: jobs that run by themselves and are asked about later."""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from uuid import uuid4

from roam_serving.access import CALLER
from roam_serving.cache import RecentCache
from roam_serving.errors import INTERNAL, ServiceError
from roam_serving.monitoring.logs import get_log

from roam_goalpose.errors import IDEMPOTENCY_KEY_REUSED, JOB_NOT_FOUND
from roam_goalpose.service.application import GoalPoseApplication
from roam_goalpose.service.queries import Answer, GoalPose, PoseQuery
from roam_goalpose.solvers.progress import Progress

log = get_log("roam_goalpose.service.jobs")

_KEPT = 1024  # jobs and idempotency keys remembered; far more than can be running


class JobState(StrEnum):
    """Where a job stands."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"


@dataclass(eq=False)
class Job:
    """A synthesis that goes on whether or not anybody watches."""

    name: str  # "jobs/…", not to be guessed
    created: datetime
    origin: tuple[str, str] | None = None  # caller and idempotency key
    progress: Progress | None = None
    goal_pose: GoalPose | None = None
    error: ServiceError | None = None

    @property
    def state(self) -> JobState:
        """Where it stands."""
        if self.error is not None:
            return JobState.FAILED
        return JobState.RUNNING if self.goal_pose is None else JobState.SUCCEEDED


class Jobs:
    """The jobs of a server, the newest of them; all methods run on the event loop."""

    def __init__(self, application: GoalPoseApplication) -> None:
        self._application = application
        self._jobs = RecentCache[str, Job](_KEPT)
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._used = RecentCache[tuple[str, str], tuple[PoseQuery, Job | None]](_KEPT)  # by caller and idempotency key

    def start(self, query: PoseQuery, idempotency_key: str = "") -> Job:
        """A new job, or the one that the same key started before. QUEUE_FULL, or IDEMPOTENCY_KEY_REUSED."""
        known = self.use_key(query, idempotency_key)
        if known is not None:
            return known
        self._application.check_room()
        origin = (CALLER.get(), idempotency_key) if idempotency_key else None
        job = Job(name=f"jobs/{uuid4().hex}", created=datetime.now(UTC), origin=origin)
        self._jobs.put(job.name, job)
        if origin is not None:
            self._used.put(origin, (query, job))
        task = asyncio.create_task(_run(job, self._application.synthesize(query)), name=job.name)
        self._tasks[job.name] = task
        task.add_done_callback(lambda _: self._tasks.pop(job.name, None))
        return job

    def use_key(self, query: PoseQuery, idempotency_key: str) -> Job | None:
        """Notes what an idempotency key was used for; the job it started, if it did.

        IDEMPOTENCY_KEY_REUSED when it stood for another request.
        """
        if not idempotency_key:
            return None
        place = (CALLER.get(), idempotency_key)
        before, job = self._used.get(place) or (query, None)
        if before != query:
            raise ServiceError(IDEMPOTENCY_KEY_REUSED, field="Idempotency-Key")
        self._used.put(place, (query, job))
        return job

    def get(self, name: str) -> Job:
        """A job; JOB_NOT_FOUND when there is none (any more)."""
        job = self._jobs.get(name)
        if job is None:
            raise ServiceError(JOB_NOT_FOUND, f"no job {name!r}")
        return job

    def delete(self, name: str) -> None:
        """Stops a job if it runs, and forgets it. JOB_NOT_FOUND when there is none."""
        job = self.get(name)
        self._jobs.drop(name)
        if job.origin is not None:
            self._used.drop(job.origin)
        if (task := self._tasks.get(name)) is not None:
            task.cancel()

    async def close(self) -> None:
        """Stops every job."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _run(job: Job, synthesis: AsyncGenerator[Progress | Answer]) -> None:
    try:
        async with aclosing(synthesis) as items:
            async for item in items:
                if isinstance(item, Answer):
                    job.goal_pose = item.goal_pose
                else:
                    job.progress = item
    except ServiceError as error:
        job.error = error
    except Exception as error:
        log.error("job failed", job=job.name, exc_info=error)
        job.error = ServiceError(INTERNAL, type(error).__name__)
