"""SkeletonService: the skeletons that the services of this process know, over gRPC and HTTP.

`serving` knows nothing of bodies; the services hand over their skeletons as messages, made by `skeleton_message` from
anything shaped like `character.skeleton.Skeleton` and `character.body.Capsules`.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import grpc
import numpy as np
from fastapi import APIRouter
from roam.v1 import skeleton_pb2, skeleton_pb2_grpc

from roam_serving.errors import ErrorKind, ServiceError

SKELETON_NOT_FOUND = ErrorKind(
    "SKELETON_NOT_FOUND",
    grpc.StatusCode.NOT_FOUND,
    404,
    "The server does not know this skeleton",
    "Use an id from ListSkeletons (GET /v1/skeletons).",
)


class TipLike(Protocol):
    """`character.skeleton.Tip`."""

    @property
    def name(self) -> str: ...
    @property
    def parent(self) -> int: ...
    @property
    def offset(self) -> tuple[float, float, float]: ...


class SkeletonLike(Protocol):
    """`character.skeleton.Skeleton`."""

    @property
    def id(self) -> str: ...
    @property
    def joint_names(self) -> tuple[str, ...]: ...
    @property
    def parents(self) -> tuple[int, ...]: ...
    @property
    def rest_offsets(self) -> np.ndarray: ...
    @property
    def rest_rotations(self) -> np.ndarray: ...
    @property
    def humanoid_bones(self) -> tuple[str, ...]: ...
    @property
    def tips(self) -> Sequence[TipLike]: ...


class CapsulesLike(Protocol):
    """`character.body.Capsules`."""

    @property
    def joints(self) -> np.ndarray: ...
    @property
    def starts(self) -> np.ndarray: ...
    @property
    def ends(self) -> np.ndarray: ...
    @property
    def radii(self) -> np.ndarray: ...


def skeleton_message(skeleton: SkeletonLike, body: CapsulesLike) -> skeleton_pb2.GetSkeletonResponse:
    """A skeleton with its stand-in body as the protocol tells it."""
    rows = zip(body.joints, body.starts, body.ends, body.radii, strict=True)
    return skeleton_pb2.GetSkeletonResponse(
        skeleton=skeleton_pb2.Skeleton(
            id=skeleton.id,
            joint_names=skeleton.joint_names,
            parents=skeleton.parents,
            rest_offsets=np.ascontiguousarray(skeleton.rest_offsets, "<f4").tobytes(),
            rest_rotations=np.ascontiguousarray(skeleton.rest_rotations, "<f4").tobytes(),
            humanoid_bones=skeleton.humanoid_bones,
            tips=[skeleton_pb2.Tip(name=t.name, joint=t.parent, offset=t.offset) for t in skeleton.tips],
        ),
        body=[
            skeleton_pb2.Capsule(joint=int(joint), start=start.tolist(), end=end.tolist(), radius=float(radius))
            for joint, start, end, radius in rows
        ],
    )


class SkeletonCatalogue:
    """Every skeleton once, in the order of the services; the first one is the default."""

    def __init__(self, skeletons: Sequence[skeleton_pb2.GetSkeletonResponse]) -> None:
        self._by_id: dict[str, skeleton_pb2.GetSkeletonResponse] = {}
        for item in skeletons:
            self._by_id.setdefault(item.skeleton.id, item)

    def __iter__(self) -> Any:
        return iter(self._by_id.values())

    def find(self, name: str) -> skeleton_pb2.GetSkeletonResponse:
        """A skeleton by id, the default one for "" or "default"; SKELETON_NOT_FOUND when there is none."""
        if name in ("", "default") and self._by_id:
            return next(iter(self._by_id.values()))
        if name not in self._by_id:
            raise ServiceError(SKELETON_NOT_FOUND, f"no skeleton {name!r}", field="skeleton")
        return self._by_id[name]


class SkeletonServicer(skeleton_pb2_grpc.SkeletonServiceServicer):
    """GetSkeleton and ListSkeletons."""

    def __init__(self, catalogue: SkeletonCatalogue) -> None:
        self._catalogue = catalogue

    async def GetSkeleton(  # noqa: N802  # gRPC's name
        self, request: skeleton_pb2.GetSkeletonRequest, context: Any
    ) -> skeleton_pb2.GetSkeletonResponse:
        """One skeleton with its stand-in body."""
        return self._catalogue.find(request.skeleton)

    async def ListSkeletons(  # noqa: N802
        self, request: skeleton_pb2.ListSkeletonsRequest, context: Any
    ) -> skeleton_pb2.ListSkeletonsResponse:
        """All skeletons, the default first."""
        return skeleton_pb2.ListSkeletonsResponse(skeletons=[item.skeleton for item in self._catalogue])


def skeletons_router(catalogue: SkeletonCatalogue) -> APIRouter:
    """GET /v1/skeletons: the same answers as JSON."""
    router = APIRouter(prefix="/v1", tags=["skeletons"])

    @router.get("/skeletons", summary="Skeletons the server knows, the default first")
    async def list_skeletons() -> dict[str, Any]:
        return {"skeletons": [skeleton_json(item) for item in catalogue]}

    @router.get("/skeletons/{skeleton}", summary="One skeleton by id, or `default`")
    async def get_skeleton(skeleton: str) -> dict[str, Any]:
        return skeleton_json(catalogue.find(skeleton))

    return router


def skeleton_json(item: skeleton_pb2.GetSkeletonResponse) -> dict[str, Any]:
    """A skeleton and its body as JSON: arrays are nested lists, metres, xyzw."""
    skeleton = item.skeleton
    return {
        "id": skeleton.id,
        "joint_names": list(skeleton.joint_names),
        "parents": list(skeleton.parents),
        "rest_offsets": np.frombuffer(skeleton.rest_offsets, "<f4").reshape(-1, 3).tolist(),
        "rest_rotations": np.frombuffer(skeleton.rest_rotations, "<f4").reshape(-1, 4).tolist(),
        "humanoid_bones": list(skeleton.humanoid_bones),
        "tips": [{"name": t.name, "joint": t.joint, "offset": list(t.offset)} for t in skeleton.tips],
        "body": [{"joint": c.joint, "start": list(c.start), "end": list(c.end), "radius": c.radius} for c in item.body],
    }
