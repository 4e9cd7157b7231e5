"""The demo page as one more service of the server that runs both: same origin, same port, no build step."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc
import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.responses import FileResponse, JSONResponse
from roam.v1 import skeleton_pb2
from roam_client.types.objects import format_of
from roam_serving.monitoring.metrics import Metrics
from roam_serving.monitoring.readiness import Readiness
from starlette.staticfiles import StaticFiles

from roam_command.installation import bundled_objects

FOLDER = Path(__file__).parent / "viewer"


@dataclass(frozen=True)
class Upload:
    """A furniture file and how to read it."""

    path: Path
    unit: str | None = None
    up: str | None = None


class PageService:
    """The page, the furniture it offers, and the triangles of uploads for display; a `serving.service.Service`."""

    name = "demo"

    def __init__(self, first: Upload) -> None:
        others = [Upload(path) for path in bundled_objects().values() if path.resolve() != first.path.resolve()]
        self._uploads = [first, *others]

    @property
    def models(self) -> Mapping[str, str]:
        """None of its own."""
        return {}

    @property
    def limits(self) -> Mapping[str, int]:
        """None of its own."""
        return {}

    @property
    def skeletons(self) -> Sequence[skeleton_pb2.GetSkeletonResponse]:
        """None of its own."""
        return ()

    async def load(self, metrics: Metrics, readiness: Readiness) -> None:
        """Nothing to load."""

    def add_to(self, server: grpc.aio.Server) -> Sequence[str]:
        """Nothing over gRPC."""
        return ()

    async def drain(self) -> None:
        """Nothing to end."""

    async def close(self) -> None:
        """Nothing to stop."""

    def router(self) -> APIRouter:
        """The page and what only it needs; poses and motion come from the services' own routes."""
        router = APIRouter(include_in_schema=False)

        @router.get("/")
        async def index() -> FileResponse:
            return FileResponse(FOLDER / "index.html")

        @router.get("/viewer/objects")
        async def objects() -> dict[str, Any]:
            return {"objects": [_describe(i, upload) for i, upload in enumerate(self._uploads)]}

        @router.get("/viewer/objects/{index}")
        async def object_file(index: int) -> Response:
            if not 0 <= index < len(self._uploads):
                return JSONResponse({"detail": f"no object {index}"}, status_code=404)
            return FileResponse(self._uploads[index].path, media_type="application/octet-stream")

        @router.post("/viewer/mesh")
        async def mesh(request: Request, format: str) -> Response:
            data = await request.body()
            try:
                content = await asyncio.to_thread(triangles, data, format)
            except ValueError as error:
                return JSONResponse({"detail": str(error)}, status_code=422)
            return Response(content, media_type="application/octet-stream")

        files = StaticFiles(directory=FOLDER)

        @router.get("/viewer/{path:path}")
        async def file(path: str, request: Request) -> Response:
            return await files.get_response(path, request.scope)

        return router


def _describe(index: int, upload: Upload) -> dict[str, Any]:
    """What the page needs to send the file to goalpose."""
    return {
        "title": upload.path.stem.replace("_", " "),
        "address": f"/viewer/objects/{index}",
        "format": format_of(upload.path),
        "unit": upload.unit,
        "up": upload.up,
    }


def triangles(data: bytes, format: str) -> bytes:
    """A file's triangles in file coordinates: uint32 V, F, then float32 [V, 3], uint32 [F, 3], little-endian.

    ValueError when the file cannot be read; a point cloud has no faces.
    """
    from roam_goalpose.objects.limits import Limits
    from roam_goalpose.objects.reading import read_geometry

    geometry = read_geometry(data, format, Limits())
    vertices = np.ascontiguousarray(geometry.vertices, "<f4")
    faces = np.zeros((0, 3), "<u4") if geometry.faces is None else np.ascontiguousarray(geometry.faces, "<u4")
    return np.array([len(vertices), len(faces)], "<u4").tobytes() + vertices.tobytes() + faces.tobytes()
