"""A replica that takes a session over tells applied controls again; a stream's user hears of each once."""

from roam.v1 import motion_pb2
from roam_client.streams.stream_state import ControlCounter, StreamState


def applied(control_id):
    event = motion_pb2.SessionEvent(
        type=motion_pb2.EVENT_TYPE_CONTROL_APPLIED, sequence=7 + control_id, control_id=control_id
    )
    return motion_pb2.AnimateResponse(event=event)


def told(state, ids):
    items = [state.receive(applied(control_id)) for control_id in ids]
    return [item.control_id for item in items if item is not None]


def test_an_applied_control_is_told_once_however_often_it_comes():
    state = StreamState("sessions/a", ControlCounter())
    assert told(state, [1, 2]) == [1, 2]
    state.opening()  # the connection broke, and the next replica tells what it cannot know to have been told
    assert told(state, [1, 2, 3]) == [3]


def test_what_broke_off_before_it_was_told_is_told_afterwards():
    state = StreamState("sessions/a", ControlCounter())
    assert told(state, [1]) == [1]
    state.opening()
    assert told(state, [1, 2]) == [2]


def test_what_is_remembered_has_a_bound():
    state = StreamState("sessions/a", ControlCounter())
    assert len(told(state, range(1, 3001))) == 3000
    assert len(state._told) <= 1024
