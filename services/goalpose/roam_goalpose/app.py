"""Wiring of the server: `python -m roam_goalpose.app`, or `async with goalpose_server(settings) as addresses`."""

import asyncio
from collections.abc import Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path

import grpc
import torch
from fastapi import APIRouter
from roam_character.body import body_capsules
from roam_character.skeleton import humanoid_skeleton
from roam_serving.endpoints.skeletons import skeleton_message
from roam_serving.errors import NOT_READY, ServiceError
from roam_serving.monitoring.metrics import Metrics
from roam_serving.monitoring.readiness import Readiness
from roam_serving.server import Addresses, running
from roam_serving.server import main as run
from roam_serving.shipped import weights_of

from roam_goalpose.api import rpc
from roam_goalpose.api.http import goalpose_router
from roam_goalpose.objects import Limits, load_shape
from roam_goalpose.objects.isolation import IsolatedLoader
from roam_goalpose.service.application import GoalPoseApplication, ReadsObjects, SynthesizesPoses
from roam_goalpose.service.jobs import Jobs
from roam_goalpose.service.pool import SynthesizerPool
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import Synthesizer, SynthesizerSettings


class GoalPoseService:
    """The goal pose service as `serving` runs it; implements serving.service.Service."""

    name = "goalpose"

    def __init__(self, settings: GoalPoseSettings) -> None:
        self._settings = settings
        self._application: GoalPoseApplication | None = None
        self._jobs: Jobs | None = None
        self._pool: SynthesizerPool | None = None
        self._loader: IsolatedLoader | None = None
        self._models: dict[str, str] = {}
        skeleton = humanoid_skeleton()
        self.skeletons = [skeleton_message(skeleton, body_capsules(skeleton))]

    @property
    def models(self) -> Mapping[str, str]:
        """The field's name and hash."""
        return self._models

    @property
    def limits(self) -> Mapping[str, int]:
        """Limits that clients plan with."""
        return {
            "max_upload_bytes": self._settings.max_upload_bytes,
            "max_inline_points": self._settings.max_inline_points,
            "max_restarts": self._settings.max_restarts,
            "queue_limit": self._settings.queue_limit,
        }

    async def load(self, metrics: Metrics, readiness: Readiness) -> None:
        """Loads the field and the reference pairs."""
        torch.set_num_threads(self._settings.torch_threads)
        synthesizer, load = await asyncio.gather(
            asyncio.to_thread(self._load_synthesizer),
            asyncio.to_thread(self._warm_reader),
        )
        self._models = {"field": synthesizer.field_name}
        self._application = GoalPoseApplication(synthesizer, load, self._settings, metrics.registry)
        self._jobs = Jobs(self._application)

    def router(self) -> APIRouter:
        """HTTP routes."""
        return goalpose_router(self._loaded, self._loaded_jobs)

    def add_to(self, server: grpc.aio.Server) -> Sequence[str]:
        """The gRPC service."""
        return rpc.add_to(server, self._loaded)

    async def drain(self) -> None:
        """Nothing to tell: requests that run may finish."""

    async def close(self) -> None:
        """Ends jobs, processes and threads."""
        if self._jobs is not None:
            await self._jobs.close()
        if self._application is not None:
            self._application.close()
        if self._loader is not None:
            await asyncio.to_thread(self._loader.close)
        if self._pool is not None:
            await asyncio.to_thread(self._pool.close)

    def _warm_reader(self) -> ReadsObjects:
        """What uploads are read with; starting a child process takes about as long as loading the field."""
        if not self._settings.isolate_uploads:
            return load_shape
        self._loader = IsolatedLoader(limits=Limits(bytes=self._settings.max_upload_bytes))
        self._loader.warm()
        return self._loader.load

    def _load_synthesizer(self) -> SynthesizesPoses:
        """The networks, here or in processes of their own."""
        settings = _synthesizer_settings(self._settings)
        if not self._settings.workers:
            with weights_of("the descriptor field", settings.weights):
                return Synthesizer.load(settings)
        self._pool = SynthesizerPool(
            settings,
            processes=self._settings.workers,
            lanes=self._settings.worker_lanes,
            torch_threads=self._settings.torch_threads,
        )
        return self._pool

    def _loaded_jobs(self) -> Jobs:
        self._loaded()
        assert self._jobs is not None
        return self._jobs

    def _loaded(self) -> GoalPoseApplication:
        if self._application is None:
            raise ServiceError(NOT_READY, "the descriptor field is loading", retry_after=1.0)
        return self._application


def _synthesizer_settings(settings: GoalPoseSettings) -> SynthesizerSettings:
    shipped = SynthesizerSettings()
    return SynthesizerSettings(
        weights=Path(settings.field_weights) if settings.field_weights else shipped.weights,
        references=Path(settings.references) if settings.references else shipped.references,
    )


def goalpose_server(settings: GoalPoseSettings | None = None) -> AbstractAsyncContextManager[Addresses]:
    """The goal pose server inside this event loop, ready; addresses as the context's value."""
    settings = settings or GoalPoseSettings()
    return running([GoalPoseService(settings)], settings)


def main() -> None:
    """`python -m roam_goalpose.app`; see --help."""
    run(GoalPoseSettings, GoalPoseService, program="python -m roam_goalpose.app")


if __name__ == "__main__":
    main()
