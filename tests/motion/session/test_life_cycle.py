"""Whatever clients, replicas and deaths do to one session, in whatever order: its frames are those of its controls."""

import asyncio
import itertools

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from prometheus_client import CollectorRegistry
from requests_of import steer
from roam_motion.session.application import MotionApplication
from roam_motion.session.ownership import Ownership
from roam_motion.session.records import SessionRequest
from roam_motion.session.session import FrameRecord
from roam_motion.session.store.memory import MemoryStore
from roam_motion.session.stream import Pacing, StreamOptions
from roam_motion.settings import MotionSettings
from walker import Place, Walker

LEASE = 1000.0
SETTINGS = MotionSettings(session_lease=LEASE, snapshot_frames=3, history_frames=60, burst_frames=4, ring_frames=16)


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


class LifeOfASession(RuleBasedStateMachine):
    """One character, one reader that comes back after every break, and replicas that die or leave."""

    def __init__(self):
        super().__init__()
        self.loop = asyncio.new_event_loop()
        self.clock = Clock()
        self.store = MemoryStore(self.clock)
        self.controls = {}  # control_id → (first frame it can affect, velocity)
        self.seen = {}  # sequence → x of the root
        self.connection = None

    def run(self, awaitable):
        return self.loop.run_until_complete(awaitable)

    @initialize()
    def create(self):
        self.replica = self.made()
        self.session = self.run(self.replica.create_session(SessionRequest(request_id="one")))
        self.name, self.token = self.session.name, self.session.record.resume_token

    def made(self):
        replica = MotionApplication(
            Walker(),
            Walker.skeleton,
            SETTINGS,
            CollectorRegistry(),
            store=self.store,
            restore=Place.joined,
        )
        self.run(replica.ownership.renew())
        return replica

    @rule(velocity=st.integers(-5, 5))
    def steer(self, velocity):
        control_id = len(self.controls) + 1
        effective = self.run(self.replica.control(self.name, steer(control_id, velocity)))
        assert effective > max(self.seen, default=0)
        self.controls[control_id] = effective, velocity

    @precondition(lambda self: self.controls)
    @rule(data=st.data())
    def send_a_control_again(self, data):
        control_id = data.draw(st.sampled_from(sorted(self.controls)))
        assert self.run(self.replica.control(self.name, steer(control_id, 9))) == self.controls[control_id][0]

    @rule()
    def create_again(self):
        again = self.run(self.replica.create_session(SessionRequest(request_id="one")))
        assert again.name == self.name

    @rule(frames=st.integers(1, 7))
    def read(self, frames):
        self.run(self._read(frames))

    async def _read(self, frames):
        if self.connection is None:
            last = max(self.seen, default=0)
            token = self.token if last else ""
            self.connection = self.replica.stream(self.name, StreamOptions(Pacing.BURST, last, token))
            self.stream = await self.connection.__aenter__()
            start = await anext(self.stream)
            assert not start.discontinuity or not last
            self.next = start.first_sequence
        for _ in range(frames):
            while self.stream.session.sequence < self.next:
                await self.replica.ticker.step([self.stream.session])
                self.note_snapshots()
            item = await anext(self.stream)
            while not isinstance(item, FrameRecord):
                item = await anext(self.stream)
            assert item.sequence == self.next
            self.next += 1
            self.seen[item.sequence] = float(item.data.root_position[0])

    def note_snapshots(self):
        """What the background does."""
        ownership: Ownership = self.replica.ownership
        self.loop.create_task(ownership._write())

    @rule()
    def disconnect(self):
        if self.connection is not None:
            self.run(self.connection.__aexit__(None, None, None))
            self.connection = None

    @rule()
    def die(self):
        self.disconnect()
        self.replica.ticker.close()
        self.clock.now += LEASE + 1
        self.run(self.store.keep({self.name: 1e9}))
        self.replica = self.made()

    @rule()
    def leave(self):
        self.disconnect()
        self.run(self.replica.drain())
        self.replica.ticker.close()
        self.replica = self.made()

    @invariant()
    def the_way_is_that_of_the_controls(self):
        changes = dict(self.controls.values())
        x, velocity = 0.0, 0.0
        for sequence in range(1, max(self.seen, default=0) + 1):
            velocity = changes.get(sequence, velocity)
            x += velocity / 30
            if sequence in self.seen:
                assert abs(self.seen[sequence] - x) < 1e-4, sequence

    @invariant()
    def no_frame_is_missing_once_reading_began(self):
        sequences = sorted(self.seen)
        assert all(after == before + 1 for before, after in itertools.pairwise(sequences))

    def teardown(self):
        self.disconnect()
        self.replica.ticker.close()
        self.loop.run_until_complete(asyncio.sleep(0))
        self.loop.close()


TestLifeOfASession = LifeOfASession.TestCase
TestLifeOfASession.settings = settings(max_examples=40, stateful_step_count=25, deadline=None)
