"""What a service gives to the server that runs it."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import grpc
from fastapi import APIRouter
from roam.v1 import skeleton_pb2

from roam_serving.monitoring.metrics import Metrics
from roam_serving.monitoring.readiness import Readiness


class Service(Protocol):
    """One application object with its HTTP and gRPC translations; `serving.server.running` runs several in one loop."""

    @property
    def name(self) -> str:
        """One word: goalpose, motion."""
        ...

    @property
    def models(self) -> Mapping[str, str]:
        """Loaded models by name with the hash of their weights; empty before `load`."""
        ...

    @property
    def limits(self) -> Mapping[str, int]:
        """Limits by name, as GetServerInfo tells them."""
        ...

    @property
    def skeletons(self) -> Sequence[skeleton_pb2.GetSkeletonResponse]:
        """Every skeleton the service knows, the default one first."""
        ...

    async def load(self, metrics: Metrics, readiness: Readiness) -> None:
        """Loads weights and starts background work; called once, with the ports already open."""
        ...

    def router(self) -> APIRouter:
        """The HTTP routes."""
        ...

    def add_to(self, server: grpc.aio.Server) -> Sequence[str]:
        """Adds the gRPC services; returns their full names."""
        ...

    async def drain(self) -> None:
        """Tells connected clients that the server goes away and ends their streams."""
        ...

    async def close(self) -> None:
        """Stops background work."""
        ...
