"""A real reader over a real connection that stops reading for a while: what it finds when it comes back is fresh."""

import asyncio
import time

import grpc
import pytest
from roam.v1 import motion_pb2, motion_pb2_grpc
from roam_client import Client, EventType, Frame
from roam_motion.settings import MotionSettings

STALL = 1.5  # [s], 45 frames
WINDOW = MotionSettings().ack_window


def head_of(address, session):
    """The newest frame of a session."""
    with grpc.insecure_channel(address) as channel:
        request = motion_pb2.GetSessionRequest(name=session.name)
        return motion_pb2_grpc.MotionServiceStub(channel).GetSession(request).session.last_sequence


def read_stall_read(address, duplex):
    """What a reader had before it stalled and had on its way, the head at its return, and what it got then."""
    with Client(motion=address) as client, client.create_session() as session:
        opened = session.stream() if duplex else session.watch()
        with opened as stream:
            items = iter(stream)
            old = [item.sequence for item, _ in zip(items, range(3), strict=False)]
            time.sleep(STALL)
            head = head_of(address, session)
            for item in items:
                if isinstance(item, Frame):
                    old.append(item.sequence)
                elif item.type is EventType.FRAMES_SKIPPED:
                    break
            return old, head, next(items).sequence


@pytest.mark.parametrize("duplex", [True, False], ids=["animate", "watch"])
async def test_a_reader_that_stalled_gets_a_fresh_frame_at_once(motion_addresses, duplex):
    old, head, fresh = await asyncio.to_thread(read_stall_read, motion_addresses.grpc, duplex)
    assert len(old) <= 3 + WINDOW
    assert head > old[-1] + WINDOW
    assert fresh >= head - 2
