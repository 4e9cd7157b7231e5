"""A place to look at, from the wire to the intent, on every transport alike."""

import numpy as np
import pytest
from roam.v1 import motion_pb2
from roam_character.skeleton import humanoid_skeleton
from roam_client.sessions.controls import steer
from roam_motion.api.messages import control_request
from roam_motion.api.schemas import ControlJson
from roam_motion.control.intent import Idle, Steer
from roam_serving.errors import ServiceError

SKELETON = humanoid_skeleton()
PLACE = (1.0, 1.5, -2.0)


@pytest.mark.parametrize(("velocity", "kind"), [((0.0, 1.0), Steer), ((0.0, 0.0), Idle)])
def test_both_transports_say_the_same(velocity, kind):
    message = steer(*velocity, look_at=PLACE)
    body = ControlJson.model_validate({"steer": {"velocity": list(velocity), "look_at": list(PLACE)}})
    found = [control_request(message, SKELETON).change.intent, body.request(SKELETON).change.intent]
    assert [type(intent) for intent in found] == [kind, kind]
    assert [intent.look_at.tolist() for intent in found] == [list(PLACE)] * 2


def test_nothing_to_look_at_is_none():
    assert control_request(steer(0.0, 1.0), SKELETON).change.intent.look_at is None


def test_above_another_floor_it_is_the_same_place():
    change = control_request(steer(0.0, 1.0, look_at=PLACE), SKELETON).change
    np.testing.assert_allclose(change.lowered(0.5).intent.look_at, [1.0, 1.0, -2.0])


def test_a_place_that_is_none_is_refused():
    message = motion_pb2.ControlInput(steer=motion_pb2.Steer(velocity_z=1.0))
    message.steer.look_at.x = float("nan")
    with pytest.raises(ServiceError) as caught:
        control_request(message, SKELETON)
    assert caught.value.field == "control.steer.look_at"
