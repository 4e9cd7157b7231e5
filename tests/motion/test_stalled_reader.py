"""A real reader over a real connection that stops reading for a while: what it finds when it comes back is fresh."""

import asyncio
import time

import grpc
import pytest
from motion.settings import MotionSettings
from roam.v1 import motion_pb2, motion_pb2_grpc
from roam_client import Client, EventType, Frame

STALL = 1.5  # [s], 45 frames
WINDOW = MotionSettings().ack_window


def read_stall_read(address, duplex):
    """Sequences before and after the first skip of a reader that stalls, and the head of the session at the end."""
    with Client(motion=address) as client, client.create_session() as session:
        opened = session.stream() if duplex else session.watch()
        with opened as stream:
            items = iter(stream)
            before = [item.sequence for item, _ in zip(items, range(3), strict=False)]
            time.sleep(STALL)
            for item in items:
                if isinstance(item, Frame):
                    before.append(item.sequence)
                elif item.type is EventType.FRAMES_SKIPPED:
                    break
            fresh = next(items).sequence
            with grpc.insecure_channel(address) as channel:
                request = motion_pb2.GetSessionRequest(name=session.name)
                head = motion_pb2_grpc.MotionServiceStub(channel).GetSession(request).session.last_sequence
    return before, fresh, head


@pytest.mark.parametrize("duplex", [True, False], ids=["animate", "watch"])
async def test_a_reader_that_stalled_gets_a_fresh_frame_at_once(motion_addresses, duplex):
    before, fresh, head = await asyncio.to_thread(read_stall_read, motion_addresses.grpc, duplex)
    assert len(before) <= 3 + WINDOW
    assert fresh - before[-1] > WINDOW
    assert head - fresh <= 2
