"""Wiring of the goal pose server: `python -m goalpose.app`, or `async with goalpose_server(settings) as addresses`."""

import asyncio
from collections.abc import Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path

import grpc
import torch
from character.body import body_capsules
from character.skeleton import humanoid_skeleton
from fastapi import APIRouter
from serving.errors import NOT_READY, ServiceError
from serving.metrics import Metrics
from serving.readiness import Readiness
from serving.server import Addresses, running, serve
from serving.skeletons import skeleton_message

from goalpose import rpc
from goalpose.application import GoalPoseApplication, ReadsObjects
from goalpose.http import goalpose_router
from goalpose.objects import Limits, load_shape
from goalpose.objects.isolation import IsolatedLoader
from goalpose.settings import GoalPoseSettings
from goalpose.synthesis import Synthesizer, SynthesizerSettings


class GoalPoseService:
    """The goal pose service as `serving` runs it; implements serving.service.Service."""

    name = "goalpose"

    def __init__(self, settings: GoalPoseSettings) -> None:
        self._settings = settings
        self._application: GoalPoseApplication | None = None
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
            asyncio.to_thread(Synthesizer.load, _synthesizer_settings(self._settings)),
            asyncio.to_thread(self._warm_reader),
        )
        self._models = {"field": synthesizer.field_name}
        self._application = GoalPoseApplication(synthesizer, load, self._settings, metrics.registry)

    def router(self) -> APIRouter:
        """HTTP routes."""
        return goalpose_router(self._loaded)

    def add_to(self, server: grpc.aio.Server) -> Sequence[str]:
        """The gRPC service."""
        return rpc.add_to(server, self._loaded)

    async def drain(self) -> None:
        """Nothing to tell: requests that run may finish."""

    async def close(self) -> None:
        """Frees the threads."""
        if self._application is not None:
            self._application.close()
        if self._loader is not None:
            await asyncio.to_thread(self._loader.close)

    def _warm_reader(self) -> ReadsObjects:
        """What uploads are read with; starting a child process takes about as long as loading the field."""
        if not self._settings.isolate_uploads:
            return load_shape
        self._loader = IsolatedLoader(limits=Limits(bytes=self._settings.max_upload_bytes))
        self._loader.warm()
        return self._loader.load

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
    """`python -m goalpose.app`; see --help."""
    settings = GoalPoseSettings(_cli_parse_args=True, _cli_prog_name="python -m goalpose.app")
    serve([GoalPoseService(settings)], settings)


if __name__ == "__main__":
    main()
