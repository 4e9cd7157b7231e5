"""Two replicas, one store: a session is moved by one of them at a time, and goes on exactly where it was."""

import asyncio
from itertools import pairwise

import pytest
from prometheus_client import CollectorRegistry
from requests_of import steer
from roam_motion.errors import SESSION_ELSEWHERE, STORE_DOWN
from roam_motion.session.application import MotionApplication
from roam_motion.session.records import Event, EventKind, SessionRequest
from roam_motion.session.session import FrameRecord
from roam_motion.session.store.base import StoreDownError
from roam_motion.session.store.memory import MemoryStore
from roam_motion.session.stream import Pacing, StreamOptions, StreamStart
from roam_motion.settings import MotionSettings
from roam_serving.errors import ServiceError
from walker import Place, Walker

BURST = Pacing.BURST
LEASE = 0.4


class Store(MemoryStore):
    """A store that can be down."""

    down = False

    async def renew(self, owner, seconds):
        self._answer()
        await super().renew(owner, seconds)

    async def log(self, name, token, entry):
        self._answer()
        await super().log(name, token, entry)

    def _answer(self):
        if self.down:
            raise StoreDownError("down")


@pytest.fixture
def store():
    return Store()


@pytest.fixture
async def replica(store):
    """Makes replicas; they live until the test ends."""
    made = []

    async def make(build="a", **more):
        settings = MotionSettings(session_lease=LEASE, snapshot_frames=4, history_frames=40, burst_frames=4, **more)
        replica = MotionApplication(
            Walker(),
            Walker.skeleton,
            settings,
            CollectorRegistry(),
            store=store,
            restore=Place.joined,
            build=build,
        )
        made.append(replica)
        await replica.start()
        return replica

    yield make
    for replica in made:
        await replica.close()


async def die(replica):
    """As after SIGKILL: nothing is said and nothing more is done."""
    for task in replica._tasks:
        task.cancel()
    await asyncio.gather(*replica._tasks, return_exceptions=True)


async def create(replica, **fields):
    return await replica.create_session(SessionRequest(**fields))


def opening(session, after=0, pacing=BURST):
    token = session.record.resume_token if after else ""
    return session.name, StreamOptions(pacing, after, token)


async def read(stream, until):
    """Frames up to a sequence."""
    taken = []
    async for item in stream:
        if isinstance(item, FrameRecord):
            taken.append(item)
            if item.sequence >= until:
                break
    return taken


def way(records):
    return [float(record.data.root_position[0]) for record in records]


async def test_after_the_owners_death_the_way_goes_on_unbroken(replica):
    first, second = await replica(), await replica()
    session = await create(first)
    await first.control(session.name, steer(1, 3.0))
    async with first.stream(*opening(session)) as stream:
        early = await read(stream, 6)
        turned = await first.control(session.name, steer(2, -6.0))
        early += await read(stream, turned + 3)
    last = early[-1].sequence
    await die(first)
    async with second.stream(*opening(session, after=last)) as stream:
        start = await anext(stream)
        assert start == StreamStart(last + 1, discontinuity=False)
        late = await read(stream, last + 10)
        assert stream.session.exact
    records = early + late
    assert [record.sequence for record in records] == list(range(1, last + 11))
    steps = [after - before for before, after in pairwise(way(records))]
    assert steps == pytest.approx([0.1] * (turned - 2) + [-0.2] * (last + 11 - turned), abs=1e-5)


async def test_a_control_that_was_answered_survives_and_keeps_its_answer(replica):
    first, second = await replica(), await replica()
    session = await create(first)
    answer = await first.control(session.name, steer(7, 3.0))
    await die(first)
    assert await second.control(session.name, steer(7, 9.0)) == answer
    async with second.stream(*opening(session)) as stream:
        records = await read(stream, 2)
    assert way(records) == pytest.approx([0.1, 0.2])


async def test_a_reader_gets_frames_from_before_the_newest_snapshot(replica):
    first, second = await replica(), await replica()
    session = await create(first)
    await first.control(session.name, steer(1, 3.0))
    async with first.stream(*opening(session)) as stream:
        await read(stream, 30)
    await die(first)
    assert (await second.get_session(session.name)).sequence > 3  # claimed at its newest snapshot
    async with second.stream(*opening(session, after=3)) as stream:
        assert await anext(stream) == StreamStart(4, discontinuity=False)
        assert way(await read(stream, 12)) == pytest.approx([0.1 * n for n in range(4, 13)], abs=1e-5)


async def test_two_readers_come_back_one_further_than_the_other(replica):
    first, second = await replica(), await replica()
    session = await create(first)
    async with first.stream(*opening(session)) as stream:
        await read(stream, 20)
    await die(first)
    async with (
        second.stream(*opening(session, after=9, pacing=Pacing.REALTIME)) as behind,
        second.stream(*opening(session, after=20, pacing=Pacing.REALTIME)) as ahead,
    ):
        assert [record.sequence for record in await read(ahead, 21)] == [21]
        assert [record.sequence for record in await read(behind, 20)][:11] == list(range(10, 21))


async def test_another_kind_of_machine_does_not_promise_to_be_exact(replica):
    first, second = await replica("a"), await replica("b")
    session = await create(first)
    await die(first)
    assert not (await second.get_session(session.name)).exact


async def test_a_living_owner_is_left_alone_unless_a_reader_comes_back_elsewhere(replica):
    first, second = await replica(), await replica()
    session = await create(first)
    with pytest.raises(ServiceError) as caught:
        await second.control(session.name, steer(1, 1.0))
    assert caught.value.kind is SESSION_ELSEWHERE
    async with first.stream(*opening(session)) as old:
        await read(old, 5)
        async with second.stream(*opening(session, after=5)) as new:
            assert (await read(new, 6))[0].sequence == 6
        kinds = [item.kind async for item in old if isinstance(item, Event)]
    assert kinds[-1] == EventKind.DRAINING
    assert [len(first.sessions), len(second.sessions)] == [0, 1]


async def test_behind_a_gateway_a_session_comes_home_with_its_next_request(replica):
    away, home = await replica(session_header=True), await replica(session_header=True)
    session = await create(away)
    assert await home.control(session.name, steer(1, 1.0)) == 1
    assert [len(away.sessions), len(home.sessions)] == [0, 1]
    await away.delete_session(session.name)
    assert [len(away.sessions), len(home.sessions)] == [0, 0]


async def test_an_owner_that_hung_moves_nothing_and_learns_that_it_lost(replica):
    first, second = await replica(), await replica()
    session = await create(first)
    async with first.stream(*opening(session)) as stream:
        await read(stream, 4)
        first._tasks[0].cancel()  # renews no more, ticks on
        await asyncio.sleep(LEASE * 1.2)
        at = session.sequence
        await second.get_session(session.name)
        await asyncio.sleep(0.05)
        assert session.sequence == at
        await first.ownership.renew()
    assert session.ended
    assert len(first.sessions) == 0


async def test_no_frame_moves_while_the_store_is_down_and_all_goes_on_after(replica, store):
    only = await replica()
    session = await create(only)
    async with only.stream(*opening(session)) as stream:
        await read(stream, 4)
        store.down = True
        with pytest.raises(ServiceError) as caught:
            await only.control(session.name, steer(1, 1.0))
        assert caught.value.kind is STORE_DOWN
        assert session.last_control_id == 0
        await asyncio.sleep(LEASE * 1.2)
        at = session.sequence
        await read(stream, at)
        await asyncio.sleep(0.05)
        assert session.sequence == at
        store.down = False
        assert (await read(stream, at + 1))[0].sequence == at + 1


async def test_draining_hands_over_at_once(replica):
    first, second = await replica(), await replica()
    session = await create(first)
    async with first.stream(*opening(session)) as stream:
        await read(stream, 10)
        at = session.sequence
        await first.drain()
    assert (await second.get_session(session.name)).sequence == at


async def test_a_repeated_creation_finds_the_session_of_another_replica(replica):
    first, second = await replica(), await replica()
    session = await create(first, request_id="r")
    await first.drain()
    assert (await create(second, request_id="r")).name == session.name
