"""What every session store promises; in memory, in Redis' imitation, and in a real Redis where there is one."""

import shutil
import socket
import subprocess
import time
from dataclasses import replace

import fakeredis
import numpy as np
import pytest
from roam_character.skeleton import humanoid_skeleton
from roam_character.volume import Volume
from roam_motion.animator import Goal, Idle, Steer
from roam_motion.session.records import (
    ControlChange,
    ControlEntry,
    Event,
    EventKind,
    SessionRecord,
    Snapshot,
    volumes_of,
)
from roam_motion.session.store.base import HeldElsewhereError, MissingError, StoreDownError, SupersededError
from roam_motion.session.store.codec import RecordCodec
from roam_motion.session.store.memory import MemoryStore
from roam_motion.session.store.redis import RedisStore
from standing import seated_pose

RECORD = SessionRecord("sessions/1", "token", "request", "sha256:s", 1000.5, 60.0, 0.25)
ONE, TWO = "replica-1", "replica-2"
CODEC = RecordCodec(humanoid_skeleton())
PAUSE = ControlChange(paused=True)


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


@pytest.fixture(scope="module")
def redis_url(tmp_path_factory):
    """A real Redis that keeps nothing."""
    program = shutil.which("redis-server")
    if program is None:
        pytest.skip("needs redis-server: apt-get install redis-server")
    port = free_port()
    place = ["--port", str(port), "--bind", "127.0.0.1", "--dir", str(tmp_path_factory.mktemp("redis"))]
    process = subprocess.Popen([program, *place, "--save", ""], stdout=subprocess.DEVNULL)
    while True:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            break
        except ConnectionRefusedError:
            time.sleep(0.01)
    yield f"redis://127.0.0.1:{port}"
    process.kill()
    process.wait()


@pytest.fixture(params=["memory", "imitation", "redis"])
async def store(request):
    if request.param == "memory":
        store = MemoryStore()
    elif request.param == "imitation":
        store = RedisStore(fakeredis.FakeAsyncRedis(), CODEC)
    else:
        store = RedisStore.at(request.getfixturevalue("redis_url"), CODEC)
        await store._redis.flushall()
    yield store
    await store.close()


def snapshot(sequence, **changes):
    fields = {
        "sequence": sequence,
        "state": bytes(range(256)),
        "volume": None,
        "change": ControlChange(goal_name="mine"),
        "paused": False,
        "last_control_id": 3,
        "answers": ((1, 1), (3, 9)),
        "arrival": (2, 0.125, False),
        "reached": Event(EventKind.GOAL_REACHED, 7, "there", goal_pose="mine"),
        "build": "build",
    }
    return Snapshot(**fields | changes)


async def test_what_is_stored_comes_back_as_it_was(store):
    assert await store.create(RECORD, ONE, snapshot(0)) == RECORD.name
    await store.log(RECORD.name, 1, ControlEntry(1, 5, PAUSE))
    await store.save(RECORD, ONE, 1, snapshot(15, paused=True, arrival=(0, None, True)), keep_from=0)
    claim = await store.claim(RECORD.name, TWO)
    assert claim.record == RECORD
    assert claim.token == 2
    assert claim.snapshots == (snapshot(0), snapshot(15, paused=True, arrival=(0, None, True)))
    assert claim.controls == (ControlEntry(1, 5, PAUSE),)
    assert not claim.released


async def test_only_what_leads_to_frames_worth_keeping_is_kept(store):
    await store.create(RECORD, ONE, snapshot(0))
    for control_id, effective in [(1, 5), (2, 20), (10, 21), (11, 40)]:
        await store.log(RECORD.name, 1, ControlEntry(control_id, effective, PAUSE))
    for sequence in (15, 20, 30):
        await store.save(RECORD, ONE, 1, snapshot(sequence), keep_from=20)
    claim = await store.claim(RECORD.name, TWO)
    assert [kept.sequence for kept in claim.snapshots] == [20, 30]
    assert [entry.control_id for entry in claim.controls] == [10, 11]


async def test_a_living_owner_is_respected_and_a_silent_one_is_not(store):
    await store.renew(ONE, 0.2)
    await store.create(RECORD, ONE, snapshot(0))
    with pytest.raises(HeldElsewhereError) as caught:
        await store.claim(RECORD.name, TWO)
    assert caught.value.owner == ONE
    while True:
        try:
            claim = await store.claim(RECORD.name, TWO)
            break
        except HeldElsewhereError:
            time.sleep(0.02)
    assert claim.token == 2


def goal(value):
    """A goal whose furniture is a block of one value."""
    volume = Volume(np.zeros(3, np.float32), 0.04, 0.0, np.full((20, 20, 20), value, np.int8))
    return ControlChange(Goal(seated_pose(), volume=volume), "chair")


async def test_furniture_is_kept_once_and_only_while_something_names_it(store):
    """Snapshots and controls of one goal hold its furniture together; a later goal replaces it."""
    await store.create(RECORD, ONE, snapshot(0))
    first, second = goal(1), goal(2)
    for sequence in range(1, 9):
        change = first if sequence < 5 else second
        await store.log(RECORD.name, 1, ControlEntry(sequence, sequence, change))
        state = snapshot(sequence, change=change, volume=change.intent.volume)
        await store.save(RECORD, ONE, 1, state, keep_from=max(0, sequence - 3))
    if isinstance(store, RedisStore):
        fields = await store._redis.hkeys(f"roam:session:{RECORD.name}")
        assert [key for key in fields if key.startswith(b"v:")] == [f"v:{second.intent.volume.digest}".encode()]
    claim = await store.claim(RECORD.name, TWO)
    assert [kept.sequence for kept in claim.snapshots] == [5, 6, 7, 8]
    assert {kept.volume.packed for kept in claim.snapshots} == {second.intent.volume.packed}
    assert {entry.change.intent.volume.packed for entry in claim.controls} == {second.intent.volume.packed}


async def test_of_two_controls_of_one_frame_the_newer_is_kept(store):
    await store.create(RECORD, ONE, snapshot(0))
    for number in range(1, 200):
        await store.log(RECORD.name, 1, ControlEntry(number, 7, PAUSE, (number - 1,)))
    claim = await store.claim(RECORD.name, TWO)
    assert claim.controls == (ControlEntry(199, 7, PAUSE, (198,)),)


async def test_another_key_finds_nothing(store):
    await store.create(replace(RECORD, owner="studio"), ONE, snapshot(0))
    assert await store.claim(RECORD.name, TWO) is None
    assert await store.claim(RECORD.name, TWO, "guest") is None
    other = SessionRecord("sessions/2", "t", RECORD.request_id, "s", 0.0, 60.0, 0.0, owner="guest")
    assert await store.create(other, TWO, snapshot(0)) == other.name
    assert (await store.claim(RECORD.name, TWO, "studio")).token == 2


async def test_a_redis_that_is_nearly_full_says_so(redis_url):
    store = RedisStore.at(redis_url, CODEC)
    await store.renew(ONE, 1.0)
    assert not store.nearly_full
    used = (await store._redis.info("memory"))["used_memory"]
    await store._redis.config_set("maxmemory", int(used * 1.2))
    await store.renew(ONE, 1.0)
    full = store.nearly_full
    await store._redis.config_set("maxmemory", 0)
    await store.renew(ONE, 1.0)
    assert (full, store.nearly_full) == (True, False)
    await store.close()


async def test_the_old_token_changes_nothing_any_more(store):
    await store.create(RECORD, ONE, snapshot(0))
    await store.claim(RECORD.name, TWO)
    with pytest.raises(SupersededError):
        await store.log(RECORD.name, 1, ControlEntry(1, 1, PAUSE))
    with pytest.raises(SupersededError):
        await store.save(RECORD, ONE, 1, snapshot(15), keep_from=0)
    await store.release(RECORD.name, 1)
    await store.remove(RECORD.name, 1)
    await store.renew(TWO, 10)
    with pytest.raises(HeldElsewhereError):
        await store.claim(RECORD.name, ONE)


async def test_a_released_session_can_be_claimed_at_once(store):
    await store.renew(ONE, 10)
    await store.create(RECORD, ONE, snapshot(0))
    await store.release(RECORD.name, 1)
    claim = await store.claim(RECORD.name, TWO)
    assert (claim.token, claim.released) == (2, True)


async def test_a_removed_session_is_gone_and_its_request_id_free(store):
    await store.create(RECORD, ONE, snapshot(0))
    await store.remove(RECORD.name, 1)
    assert await store.claim(RECORD.name, TWO) is None
    other = SessionRecord("sessions/2", "t", RECORD.request_id, "s", 0.0, 60.0, 0.0)
    assert await store.create(other, TWO, snapshot(0)) == other.name


async def test_a_request_id_names_one_session(store):
    await store.create(RECORD, ONE, snapshot(0))
    again = SessionRecord("sessions/2", "t", RECORD.request_id, "s", 0.0, 60.0, 0.0)
    assert await store.create(again, TWO, snapshot(0)) == RECORD.name
    anonymous = SessionRecord("sessions/3", "t", "", "s", 0.0, 60.0, 0.0)
    assert await store.create(anonymous, TWO, snapshot(0)) == anonymous.name


async def test_a_session_that_nobody_keeps_expires(store):
    await store.create(RECORD, ONE, snapshot(0))
    assert await store.keep({RECORD.name: 0.05, "sessions/unknown": 5.0}) == {"sessions/unknown"}
    time.sleep(0.1)
    assert await store.claim(RECORD.name, TWO) is None


async def test_what_the_store_lost_is_stored_anew(store):
    with pytest.raises(MissingError):
        await store.log(RECORD.name, 4, ControlEntry(1, 1, PAUSE))
    await store.save(RECORD, ONE, 4, snapshot(30), keep_from=0)
    claim = await store.claim(RECORD.name, TWO)
    assert claim.token == 5
    assert claim.snapshots == (snapshot(30),)


async def test_questions_are_heard_once(store):
    await store.ask(ONE, "sessions/1")
    await store.ask(ONE, "sessions/1")
    await store.ask(ONE, "sessions/2")
    assert await store.asked(ONE) == {"sessions/1", "sessions/2"}
    assert await store.asked(ONE) == set()
    assert await store.asked(TWO) == set()


async def test_a_redis_that_is_not_there_is_down():
    store = RedisStore.at(f"redis://127.0.0.1:{free_port()}", CODEC)
    with pytest.raises(StoreDownError):
        await store.renew(ONE, 1.0)
    await store.close()


@pytest.mark.parametrize(
    "intent",
    [
        Idle(np.float32([1, 1.5, 2])),
        Steer(np.float32([0.1, -1 / 3])),
        Steer(np.float32([0.0, 1.0]), np.float32([0.6, 0.8])),
        Steer(np.float32([0.0, 1.0]), around=(((0.1, 1 / 3), (1.0, 0.0), (0.0, -1.0)),)),
        Idle(around=(((0.1, 1 / 3), (1.0, 0.0), (0.0, -1.0)),)),
        Goal(seated_pose(), "lie", np.float32([1.0, 0.0]), (((0.1, 1 / 3), (1.0, 0.0), (0.0, -1.0)),)),
        Goal(
            seated_pose(),
            volume=Volume(np.float32([1, 2, 3]), 0.04, 0.5, np.arange(24, dtype=np.int8).reshape(2, 3, 4)),
        ),
    ],
    ids=["idle", "steer", "steer and face", "steer past", "idle beside", "goal", "goal with furniture"],
)
def test_an_intent_that_is_written_down_comes_back_to_the_bit(intent):
    entry = ControlEntry(3, 9, ControlChange(intent, "mine"))
    again = CODEC.control(CODEC.encode(entry), {volume.digest: volume for volume in volumes_of(entry.change)})
    assert (again.control_id, again.effective, again.change.goal_name) == (3, 9, "mine")
    assert type(again.change.intent) is type(intent)
    assert CODEC.encode(again) == CODEC.encode(entry)
    if not isinstance(intent, Goal):
        assert again.change.intent.around == intent.around
    else:
        found = again.change.intent
        assert found.pose.rotations.tobytes() == intent.pose.rotations.tobytes()
        assert found.pose.root_position.tobytes() == intent.pose.root_position.tobytes()
        assert found.obstacles == intent.obstacles
        assert (found.volume and found.volume.packed) == (intent.volume and intent.volume.packed)
