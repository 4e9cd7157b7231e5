"""The client for ordinary code: `base_client` with blocking calls."""

import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import grpc

from roam_client.base_client import BaseClient, OnProgress
from roam_client.connection.calls import Answer, Call, Plan, is_silence
from roam_client.errors import RoamError
from roam_client.sessions.placement import Placement, session_request
from roam_client.sessions.sync_session import Session
from roam_client.types.actions import Action
from roam_client.types.goal_poses import GoalPose, Pose, ReferencePose
from roam_client.types.objects import Object
from roam_client.types.pose_wishes import PoseWishes
from roam_client.types.server_info import ServerInfo
from roam_client.types.skeleton import Skeleton


class Client(BaseClient):
    """Both services, or one of them.

        with Client(goalpose="localhost:50051", motion="localhost:50052") as client:
            goal = client.synthesize(client.upload("chair.glb"), reference="chair_sit")
            with client.create_session(floor_height=goal.floor_height) as session:
                motion = session.bake(goal)

    Addresses are gRPC `host:port`. `ca` or `cert` turn TLS on, `api_key` goes with every call: see `security.Security`.
    Every method raises an error of `roam_client.errors`; a call that a server's death has cut off is made again.
    """

    _grpc = grpc

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections; sessions live on until they expire."""
        for channel in self._all_channels():
            channel.close()

    # Goal poses

    def upload(
        self,
        source: str | Path | bytes,
        *,
        format: str | None = None,
        unit: str | None = None,
        up_axis: str | None = None,
        size: float | None = None,
        piece: str | None = None,
    ) -> Object:
        """Puts a furniture file on the server. Bytes need a `format`; unit and up axis are detected when not given.

        `size` is the object's height in metres, which goes before the unit; `piece` is the name or index of the one to
        take from a file of several (`Object.pieces`), the best seat when not given.
        """
        return self.run(self._upload(source, format=format, unit=unit, up_axis=up_axis, size=size, piece=piece))

    def object(self, name: str) -> Object:
        """What the server knows of an uploaded object."""
        return self.run(self._object(name))

    def reference_poses(self, *, include_points: bool = False) -> tuple[ReferencePose, ...]:
        """The poses that `synthesize` can adapt."""
        return self.run(self._reference_poses(include_points=include_points))

    def create_reference(
        self, object: Object | str, pose: Pose, *, action: Action = Action.SIT, title: str = ""
    ) -> ReferencePose:
        """Makes a pose in the world of an uploaded object a reference; its name serves `synthesize` as `reference`."""
        return self.run(self._create_reference(object, pose, action=action, title=title))

    def synthesize(
        self,
        object: Object | str,
        *,
        reference: str | None = None,
        action: Action = Action.SIT,
        restarts: int = 0,
        seed: int = 0,
        initial_yaw: float | None = None,
        solver: str = "",
        count: int = 1,
        wishes: PoseWishes | None = None,
        timeout: float = 600.0,
        on_progress: OnProgress | None = None,
    ) -> GoalPose:
        """Optimises goal poses on an uploaded object: the best, with `count` - 1 others in `alternatives`."""
        return self.run(
            self._synthesize(
                object,
                timeout=timeout,
                on_progress=on_progress,
                reference=reference,
                action=action,
                restarts=restarts,
                seed=seed,
                initial_yaw=initial_yaw,
                solver=solver,
                count=count,
                wishes=wishes,
            )
        )

    def skeleton(self, id: str = "") -> Skeleton:
        """A skeleton with its stand-in body, by id or name; the server's default when empty. Cached."""
        return self.run(self._skeleton(id))

    # Motion

    def create_session(
        self,
        start: Placement | None = None,
        *,
        seed: int = 0,
        floor_height: float = 0.0,
        idle_timeout: float | None = None,
        skeleton_id: str = "",
        request_id: str | None = None,
    ) -> Session:
        """A character standing at `start` (default: the origin, facing +Z). A `request_id` makes a retry safe."""
        request = session_request(
            start,
            seed=seed,
            floor_height=floor_height,
            idle_timeout=idle_timeout,
            skeleton_id=skeleton_id,
            request_id=request_id,
        )
        return Session(self, self.run(self._create_session(request)))

    def session(self, name: str) -> Session:
        """A session that exists already."""
        return Session(self, self.run(self._get_session(name)))

    # Servers

    def server_info(self, service: str) -> ServerInfo:
        """What a server is and what it accepts; `service` is goalpose or motion."""
        return self.run(self._server_info(service))

    # Calls

    def run(self, plan: Plan[Answer]) -> Answer:
        """Makes the calls of a plan, one after another."""
        try:
            call = next(plan)
            while True:
                try:
                    answer = self._answer(call)
                except RoamError as error:
                    call = plan.throw(error)
                else:
                    call = plan.send(answer)
        except StopIteration as end:
            result: Answer = end.value
            return result

    def _answer(self, call: Call) -> Any:
        attempts = self._attempts(call)
        while True:
            try:
                answer = self._method(call, attempts)
                if call.on_message is not None:
                    answer = next((message for message in answer if call.on_message(message)), None)
                self._reached.add(attempts.target)
                return answer
            except grpc.RpcError as error:
                pause = attempts.pause(error)
                if is_silence(error):
                    self.give_up_connection(call.service)
            time.sleep(pause)

    def give_up_connection(self, service: str) -> None:
        """Lets the next call to a service open a connection of its own."""
        for channel in self.renew(service):
            channel.close()
