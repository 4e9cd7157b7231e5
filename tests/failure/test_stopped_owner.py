"""The owner of a session is stopped, not killed: its connections stay open and say nothing."""

import signal
import time

from replicas import anyone, assert_same, unbroken, walking
from roam_client import Client, Frame, Placement

PLACE = (0.5, -1.0, 0.75)  # numbers that float32 holds
LONGEST_GAP = 3.0  # [s]


def test_a_stopped_owner_costs_a_reader_at_most_three_seconds(pair):
    first, second = pair
    frames, gap = [], 0.0
    try:
        with Client(motion=anyone(first, second)) as client:
            session = client.create_session(Placement(*PLACE))
            started = session.steer(0.3, 1.0)
            with session.stream() as stream:
                last = time.monotonic()
                for item in stream:
                    if not isinstance(item, Frame):
                        continue
                    gap, last = max(gap, time.monotonic() - last), time.monotonic()
                    frames.append(item)
                    if len(frames) == 30:
                        first.process.send_signal(signal.SIGSTOP)
                    if len(frames) == 90:
                        break
            session.delete()
    finally:
        first.process.send_signal(signal.SIGCONT)
    sequences = [frame.sequence for frame in frames]
    assert sequences == sorted(set(sequences))
    assert gap < LONGEST_GAP
    assert_same(frames, unbroken(PLACE, {started: walking(0.3, 1.0)}, frames[-1].sequence))
