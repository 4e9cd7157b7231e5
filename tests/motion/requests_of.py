"""Controls as transports hand them to the application, for the tests of sessions."""

import numpy as np
from roam_motion.animator import Idle, Steer
from roam_motion.session.records import ControlChange, ControlRequest


def steer(control_id, x=1.0, z=0.0):
    """Steering along a velocity [m/s]."""
    velocity = np.array([x, z], np.float32)
    return ControlRequest(control_id, ControlChange(Steer(velocity) if velocity.any() else Idle()))


def playback(control_id, *, paused):
    """Holding, or going on."""
    return ControlRequest(control_id, ControlChange(paused=paused))
