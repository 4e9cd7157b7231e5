"""grpc.health.v1 and server reflection, driven by the same readiness as /readyz."""

import asyncio
from collections.abc import Sequence

import grpc
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from roam_serving.monitoring.readiness import Readiness


def add_health(server: grpc.aio.Server, service_names: Sequence[str], readiness: Readiness) -> None:
    """Adds the health service; "" and every service report SERVING exactly while the server is ready."""
    servicer = health.aio.HealthServicer()
    health_pb2_grpc.add_HealthServicer_to_server(servicer, server)
    tasks: set[asyncio.Task[None]] = set()  # the loop keeps no strong reference

    async def tell(ready: bool) -> None:
        status = health_pb2.HealthCheckResponse.SERVING if ready else health_pb2.HealthCheckResponse.NOT_SERVING
        for name in ("", *service_names):
            await servicer.set(name, status)

    def on_change(ready: bool) -> None:
        task = asyncio.get_running_loop().create_task(tell(ready))
        tasks.add(task)
        task.add_done_callback(tasks.discard)

    readiness.listen(on_change)


def add_reflection(server: grpc.aio.Server, service_names: Sequence[str]) -> None:
    """Adds server reflection, so that grpcurl and friends need no .proto files."""
    names = (*service_names, health.SERVICE_NAME, reflection.SERVICE_NAME)
    reflection.enable_server_reflection(names, server)
