"""A motion session for ordinary code: `base_session` with blocking calls."""

from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from roam.v1 import motion_pb2, motion_pb2_grpc

from roam_client.connection.calls import MOTION
from roam_client.sessions import controls
from roam_client.sessions.baking import Bake, OnFrame
from roam_client.sessions.base_session import BaseSession
from roam_client.streams.stream_state import StreamState
from roam_client.streams.sync_stream import Stream
from roam_client.types.actions import Action
from roam_client.types.goal_poses import GoalPose
from roam_client.types.motions import Motion

if TYPE_CHECKING:
    from roam_client.sync_client import Client


class Session(BaseSession):
    """One character. Leaving the `with` block ends it on the server."""

    def __init__(self, client: "Client", message: motion_pb2.Session) -> None:
        super().__init__(message)
        self._client = client

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.delete()

    def delete(self) -> None:
        """Ends the session; one that has ended already is fine."""
        self._client.run(self._client._delete_session(self.name))

    def control(self, control: motion_pb2.ControlInput) -> int:
        """Applies a control; the first sequence that it can affect."""
        return self._client.run(self._client._control(self.name, self._counter.number(control)))

    def go_to(self, goal: GoalPose) -> int:
        """Walk to a goal pose and settle into it."""
        return self.control(controls.go_to(goal))

    def steer(
        self,
        velocity_x: float = 0.0,
        velocity_z: float = 0.0,
        *,
        facing: float | None = None,
        action: Action = Action.UNSPECIFIED,
    ) -> int:
        """Walk by hand; see `controls.steer`."""
        return self.control(controls.steer(velocity_x, velocity_z, facing=facing, action=action))

    def stand_up(self) -> int:
        """Leave the goal and stand."""
        return self.control(controls.stand_up())

    def stream(
        self,
        *,
        pacing: str = "realtime",
        encoding: str = "float32",
        joint_positions: bool = False,
        credit: int = 1,
        after_sequence: int = 0,
        resume_for: float = 10.0,
    ) -> Stream:
        """Frames down, controls up, in one call. `pacing`: realtime, credit, burst; `encoding`: float32, snorm16."""
        state = self._state(
            pacing, encoding, joint_positions=joint_positions, credit=credit, after_sequence=after_sequence
        )
        return self._open(state, duplex=True, resume_for=resume_for)

    def watch(
        self,
        *,
        pacing: str = "realtime",
        encoding: str = "float32",
        joint_positions: bool = False,
        after_sequence: int = 0,
        resume_for: float = 10.0,
    ) -> Stream:
        """Frames down only (WatchFrames); controls travel as calls of their own. `pacing`: realtime or burst."""
        state = self._state(pacing, encoding, joint_positions=joint_positions, credit=0, after_sequence=after_sequence)
        return self._open(state, duplex=False, resume_for=resume_for)

    def _open(self, state: StreamState, *, duplex: bool, resume_for: float) -> Stream:
        def connect(elsewhere: bool) -> Any:
            if elsewhere:
                self._client.give_up_connection(MOTION)
            return self._client.stub(motion_pb2_grpc.MotionServiceStub, MOTION, self.name)

        target = self._client.target(MOTION)
        return Stream(connect, state, target=target, duplex=duplex, resume_for=resume_for)

    def bake(
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
        self.go_to(goal)
        with self.stream(pacing=bake.pacing, joint_positions=True) as stream:
            bake.add(stream.header)
            for item in stream:
                control = bake.add(item)
                if control is not None:
                    stream.send(control)
                if bake.done:
                    break
        return bake.motion()
