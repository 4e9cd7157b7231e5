"""What both kinds of session hold. No input or output."""

from roam.v1 import motion_pb2

from roam_client.streams.stream_state import ControlCounter, StreamState


class BaseSession:
    """Name and figures of a session, and the numbers of its controls; see `Session` and `AsyncSession`."""

    def __init__(self, message: motion_pb2.Session) -> None:
        self._counter = ControlCounter()
        self.name = message.name
        self.skeleton_id = message.skeleton_id
        self.frame_rate = message.frame_rate
        self.floor_height = message.floor_height

    def _state(
        self, pacing: str, encoding: str, *, joint_positions: bool, credit: int, after_sequence: int
    ) -> StreamState:
        return StreamState(self.name, self._counter, pacing, encoding, joint_positions, credit, after_sequence)
