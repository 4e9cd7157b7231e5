"""The goal pose service over gRPC: a thin translation of GoalPoseApplication."""

from collections.abc import AsyncIterator, Callable
from contextlib import aclosing
from typing import Any

import grpc
from roam.v1 import goal_pose_pb2, goal_pose_pb2_grpc
from roam_serving.errors import INVALID_ARGUMENT, PAYLOAD_TOO_LARGE, ServiceError

from roam_goalpose.api.messages import goal_pose_message, object_message, progress_message, reference_message
from roam_goalpose.api.requests import query_from_message, reference_from_message
from roam_goalpose.service.application import GoalPoseApplication
from roam_goalpose.service.queries import Answer

# ruff: noqa: N802  # methods carry gRPC's names

SERVICE_NAME = goal_pose_pb2.DESCRIPTOR.services_by_name["GoalPoseService"].full_name


class GoalPoseServicer(goal_pose_pb2_grpc.GoalPoseServiceServicer):
    """roam.v1.GoalPoseService; `application` is called per request because it exists only once models are loaded."""

    def __init__(self, application: Callable[[], GoalPoseApplication]) -> None:
        self._application = application

    async def UploadObject(
        self, requests: AsyncIterator[goal_pose_pb2.UploadObjectRequest], context: Any
    ) -> goal_pose_pb2.UploadObjectResponse:
        """Puts an object, in chunks."""
        application = self._application()
        first: goal_pose_pb2.UploadObjectRequest | None = None
        data = bytearray()
        async for request in requests:
            first = first or request
            data += request.chunk
            if len(data) > application.settings.max_upload_bytes:
                detail = f"more than {application.settings.max_upload_bytes} bytes"
                raise ServiceError(PAYLOAD_TOO_LARGE, detail, field="chunk")
        if first is None:
            raise ServiceError(INVALID_ARGUMENT, "the upload has no message", field="format")
        size = first.size if first.HasField("size") else None
        found = await application.upload(
            bytes(data), first.format, first.unit, first.up_axis, size=size, piece=first.piece
        )
        return goal_pose_pb2.UploadObjectResponse(object=object_message(found))

    async def GetObject(self, request: goal_pose_pb2.GetObjectRequest, context: Any) -> goal_pose_pb2.GetObjectResponse:
        """Reads an object."""
        return goal_pose_pb2.GetObjectResponse(object=object_message(self._application().object(request.name)))

    async def Synthesize(
        self, request: goal_pose_pb2.SynthesizeRequest, context: Any
    ) -> AsyncIterator[goal_pose_pb2.SynthesizeResponse]:
        """Progress, then the goal pose."""
        application = self._application()
        query = await application.check(query_from_message(request))
        async with aclosing(application.synthesize(query)) as items:
            async for item in items:
                if isinstance(item, Answer):
                    context.set_trailing_metadata((("x-roam-cache", "hit" if item.cached else "miss"),))
                    yield goal_pose_pb2.SynthesizeResponse(goal_pose=goal_pose_message(item.goal_pose))
                else:
                    yield goal_pose_pb2.SynthesizeResponse(progress=progress_message(item))

    async def ListReferencePoses(
        self, request: goal_pose_pb2.ListReferencePosesRequest, context: Any
    ) -> goal_pose_pb2.ListReferencePosesResponse:
        """Lists the reference poses."""
        pairs = self._application().reference_poses()
        poses = [reference_message(pair, include_points=request.include_points) for pair in pairs]
        return goal_pose_pb2.ListReferencePosesResponse(reference_poses=poses)

    async def CreateReferencePose(
        self, request: goal_pose_pb2.CreateReferencePoseRequest, context: Any
    ) -> goal_pose_pb2.CreateReferencePoseResponse:
        """Puts a reference pose of the caller's own."""
        pair = self._application().create_reference(reference_from_message(request))
        found = reference_message(pair, include_points=False)
        return goal_pose_pb2.CreateReferencePoseResponse(reference_pose=found)


def add_to(server: grpc.aio.Server, application: Callable[[], GoalPoseApplication]) -> tuple[str, ...]:
    """Adds the service to a server; returns its full name."""
    goal_pose_pb2_grpc.add_GoalPoseServiceServicer_to_server(GoalPoseServicer(application), server)
    return (SERVICE_NAME,)
