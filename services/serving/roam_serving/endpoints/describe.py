"""ServerService: what this server is, which models it runs and what it accepts."""

from collections.abc import Sequence
from typing import Any

from fastapi import APIRouter
from roam.v1 import server_pb2, server_pb2_grpc

from roam_serving.service import Service


def server_info(services: Sequence[Service], version: str) -> server_pb2.GetServerInfoResponse:
    """Version, models and limits of all services of the process."""
    info = server_pb2.GetServerInfoResponse(version=version, services=[service.name for service in services])
    for service in services:
        info.models.update(service.models)
        info.limits.update(service.limits)
    return info


class ServerServicer(server_pb2_grpc.ServerServiceServicer):
    """GetServerInfo over gRPC."""

    def __init__(self, services: Sequence[Service], version: str) -> None:
        self._services = services
        self._version = version

    async def GetServerInfo(  # noqa: N802  # gRPC's name
        self, request: server_pb2.GetServerInfoRequest, context: Any
    ) -> server_pb2.GetServerInfoResponse:
        """Version, models and limits."""
        return server_info(self._services, self._version)


def describe_router(services: Sequence[Service], version: str) -> APIRouter:
    """GET /v1/server, the same answer as JSON."""
    router = APIRouter(prefix="/v1", tags=["server"])

    @router.get("/server", summary="Version, models and limits")
    async def get_server() -> dict[str, Any]:
        info = server_info(services, version)
        return {
            "version": info.version,
            "services": list(info.services),
            "models": dict(info.models),
            "limits": dict(info.limits),
        }

    return router
