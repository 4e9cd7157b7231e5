"""Wiring of the motion server: `python -m roam_motion.app`, or `async with motion_server(settings) as addresses`."""

import asyncio
import hashlib
from collections.abc import Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import grpc
import torch
from roam_character.body import body_capsules
from roam_character.skeleton import Skeleton, humanoid_skeleton
from roam_serving.endpoints.skeletons import skeleton_message
from roam_serving.errors import NOT_READY, ServiceError
from roam_serving.monitoring.metrics import Metrics
from roam_serving.monitoring.readiness import Readiness
from roam_serving.server import Addresses, running
from roam_serving.server import main as run
from roam_serving.shipped import WEIGHTS, weights_of

from roam_motion.animation.figure import humanoid_figure
from roam_motion.animator import Animator
from roam_motion.api import rpc
from roam_motion.control.keeping_out import left_behind
from roam_motion.control.plausibility import check_goal
from roam_motion.session.application import MotionApplication
from roam_motion.session.store.base import SessionStore
from roam_motion.session.store.codec import RecordCodec
from roam_motion.session.worker import WorkerProcess, build_name
from roam_motion.settings import MotionSettings

if TYPE_CHECKING:
    from fastapi import APIRouter

SHIPPED_WEIGHTS = WEIGHTS / "motion.safetensors"


def _load(weights: Path, settings: MotionSettings) -> tuple[Animator, WorkerProcess | None]:
    """The network, and the process that steps where it is not this one."""
    if not settings.step_process:
        return Animator.load(weights).warmed(), None
    worker = WorkerProcess(weights, torch_threads=settings.torch_threads)
    return Animator.load(weights), worker


def _store(settings: MotionSettings, skeleton: Skeleton) -> SessionStore | None:
    """The store that replicas share; None for a replica that is alone."""
    if settings.session_store == "memory":
        return None
    from roam_motion.session.store.redis import RedisStore  # here: a replica that is alone does without it

    return RedisStore.at(settings.session_store, RecordCodec(skeleton))


def _tell_health(readiness: Readiness, well: bool) -> None:
    if well:
        readiness.clear("sessions")
    else:
        readiness.block("sessions", "the session store does not answer, or moving sessions has failed; see the log")


class MotionService:
    """The motion service as `serving` runs it; implements `roam_serving.service.Service`."""

    name = "motion"

    def __init__(self, settings: MotionSettings) -> None:
        self._settings = settings
        self._application: MotionApplication | None = None
        self._worker: WorkerProcess | None = None
        self._models: dict[str, str] = {}
        self._skeleton = humanoid_skeleton()
        self.skeletons = [skeleton_message(self._skeleton, body_capsules(self._skeleton))]

    @property
    def models(self) -> Mapping[str, str]:
        """The network's name and hash."""
        return self._models

    @property
    def limits(self) -> Mapping[str, int]:
        """Limits that clients plan with."""
        return {"max_sessions": self._settings.max_sessions, "ring_frames": self._settings.ring_frames}

    async def load(self, metrics: Metrics, readiness: Readiness) -> None:
        """Loads the network and starts the ticker."""
        torch.set_num_threads(self._settings.torch_threads)
        weights = Path(self._settings.motion_weights) if self._settings.motion_weights else SHIPPED_WEIGHTS
        if not weights.exists():
            raise FileNotFoundError(f"no motion weights at {weights}; train them with `roam train motion`")
        with weights_of("the motion network", weights):
            animator, self._worker = await asyncio.to_thread(_load, weights, self._settings)
        digest = f"sha256:{hashlib.sha256(weights.read_bytes()).hexdigest()}"
        self._models = {"motion": digest}
        self._application = MotionApplication(
            animator,
            self._skeleton,
            self._settings,
            metrics.registry,
            store=_store(self._settings, self._skeleton),
            frames=self._worker.frames if self._worker else None,
            build=build_name(digest),
            check_goal=partial(check_goal, humanoid_figure()),
            left_behind=partial(left_behind, humanoid_figure()),
            on_health=partial(_tell_health, readiness),
            on_failure=partial(readiness.fail, "motion"),
        )
        await self._application.start()

    def router(self) -> "APIRouter":
        """HTTP and WebSocket routes."""
        from fastapi import APIRouter  # here: gRPC alone does without it

        from roam_motion.api.http import motion_router
        from roam_motion.api.websocket import websocket_router

        router = APIRouter()
        router.include_router(motion_router(self._loaded))
        router.include_router(websocket_router(self._loaded, self.skeletons[0].skeleton))
        return router

    def add_to(self, server: grpc.aio.Server) -> Sequence[str]:
        """The gRPC service."""
        return rpc.add_to(server, self._loaded, self.skeletons[0].skeleton)

    async def drain(self) -> None:
        """Ends the streams and hands the sessions over."""
        if self._application is not None:
            await self._application.drain()

    async def close(self) -> None:
        """Stops the ticker and the process that steps."""
        if self._application is not None:
            await self._application.close()
        if self._worker is not None:
            await asyncio.to_thread(self._worker.close)

    def _loaded(self) -> MotionApplication:
        if self._application is None:
            raise ServiceError(NOT_READY, "the motion model is loading", retry_after=1.0)
        return self._application


def motion_server(settings: MotionSettings | None = None) -> AbstractAsyncContextManager[Addresses]:
    """The motion server inside this event loop, ready; addresses as the context's value."""
    settings = settings or MotionSettings()
    return running([MotionService(settings)], settings)


def main() -> None:
    """`python -m roam_motion.app`; see --help."""
    run(MotionSettings, MotionService, program="python -m roam_motion.app")


if __name__ == "__main__":
    main()
