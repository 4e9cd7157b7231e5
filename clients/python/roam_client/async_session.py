"""A motion session for asyncio. The twin for ordinary code is `sync_session`; keep the two alike."""

from types import TracebackType
from typing import Self

from roam.v1 import motion_pb2, motion_pb2_grpc

from roam_client import controls
from roam_client.actions import Action
from roam_client.async_stream import AsyncStream
from roam_client.baking import Bake, OnFrame
from roam_client.errors import NotFoundError, server_errors
from roam_client.goal_poses import GoalPose
from roam_client.motions import Motion
from roam_client.stream_state import ControlCounter, StreamState


class AsyncSession:
    """One character. Leaving the `async with` block ends it on the server."""

    def __init__(
        self, stub: motion_pb2_grpc.MotionServiceStub, message: motion_pb2.Session, *, target: str, timeout: float
    ) -> None:
        self._stub = stub
        self._target = target
        self._timeout = timeout
        self._counter = ControlCounter()
        self.name = message.name
        self.skeleton_id = message.skeleton_id
        self.frame_rate = message.frame_rate
        self.floor_height = message.floor_height

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.delete()

    async def delete(self) -> None:
        """Ends the session; one that has ended already is fine."""
        try:
            with server_errors(self._target):
                await self._stub.DeleteSession(motion_pb2.DeleteSessionRequest(name=self.name), timeout=self._timeout)
        except NotFoundError:
            return

    async def control(self, control: motion_pb2.ControlInput) -> int:
        """Applies a control; the first sequence that it can affect."""
        numbered = motion_pb2.ControlInput()
        numbered.CopyFrom(control)
        numbered.control_id = self._counter.next()
        request = motion_pb2.ControlRequest(session=self.name, control=numbered)
        with server_errors(self._target):
            return (await self._stub.Control(request, timeout=self._timeout)).effective_sequence

    async def go_to(self, goal: GoalPose) -> int:
        """Walk to a goal pose and settle into it."""
        return await self.control(controls.go_to(goal))

    async def steer(
        self,
        velocity_x: float = 0.0,
        velocity_z: float = 0.0,
        *,
        facing: float | None = None,
        action: Action = Action.UNSPECIFIED,
    ) -> int:
        """Walk by hand; see `controls.steer`."""
        return await self.control(controls.steer(velocity_x, velocity_z, facing=facing, action=action))

    async def stand_up(self) -> int:
        """Leave the goal and stand."""
        return await self.control(controls.stand_up())

    def stream(
        self,
        *,
        pacing: str = "realtime",
        encoding: str = "float32",
        joint_positions: bool = False,
        credit: int = 1,
        after_sequence: int = 0,
        resume_for: float = 10.0,
    ) -> AsyncStream:
        """Frames down, controls up, in one call. `pacing`: realtime, credit, burst; `encoding`: float32, snorm16."""
        state = StreamState(self.name, self._counter, pacing, encoding, joint_positions, credit, after_sequence)
        return AsyncStream(self._stub, state, target=self._target, duplex=True, resume_for=resume_for)

    def watch(
        self,
        *,
        pacing: str = "realtime",
        encoding: str = "float32",
        joint_positions: bool = False,
        after_sequence: int = 0,
        resume_for: float = 10.0,
    ) -> AsyncStream:
        """Frames down only (WatchFrames); controls travel as calls of their own. `pacing`: realtime or burst."""
        state = StreamState(self.name, self._counter, pacing, encoding, joint_positions, 0, after_sequence)
        return AsyncStream(self._stub, state, target=self._target, duplex=False, resume_for=resume_for)

    async def bake(
        self,
        goal: GoalPose,
        *,
        hold: float = 1.0,
        stand_up: bool = False,
        max_frames: int = 900,
        on_frame: OnFrame | None = None,
    ) -> Motion:
        """The whole way into a goal pose, as fast as it can be computed; see `Bake` for when it ends."""
        bake = Bake(goal, hold=hold, stand_up=stand_up, max_frames=max_frames, on_frame=on_frame)
        await self.go_to(goal)
        async with self.stream(pacing=bake.pacing, joint_positions=True) as stream:
            bake.add(stream.header)
            async for item in stream:
                control = bake.add(item)
                if control is not None:
                    await stream.send(control)
                if bake.done:
                    break
        return bake.motion()
