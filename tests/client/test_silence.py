"""A network or a server that falls silent without a word, and streams that are closed from elsewhere."""

import asyncio
import threading
import time
from collections.abc import Iterator

import pytest
from fake_services import Fake
from roam_client import AsyncClient, Client, ConnectionFailedError, Frame, controls
from silent_proxy import SilentProxy, silent_proxy

LONGEST_GAP = 3.0  # [s]


@pytest.fixture
def proxy(fake: Fake) -> Iterator[SilentProxy]:
    with silent_proxy(fake.address) as running:
        yield running


def addresses(proxy: SilentProxy, fake: Fake) -> str:
    """The proxied replica first, a healthy one after it."""
    return f"ipv4:{proxy.address},{fake.other_address}"


@pytest.mark.parametrize("duplex", [True, False])
def test_a_silent_realtime_stream_goes_on_elsewhere(fake: Fake, proxy: SilentProxy, duplex: bool):
    with Client(motion=addresses(proxy, fake)) as client:
        session = client.create_session()
        with session.stream() if duplex else session.watch() as stream:
            sequences, gap, last = [], 0.0, time.monotonic()
            for frame in stream.frames():
                gap, last = max(gap, time.monotonic() - last), time.monotonic()
                sequences.append(frame.sequence)
                if len(sequences) == 10:
                    proxy.silence()
                if len(fake.motions.opens) == 2 and len(sequences) > 20:
                    break
    assert sequences == list(range(1, len(sequences) + 1))
    assert gap < LONGEST_GAP
    assert fake.motions.opens[1].after_sequence >= 10


async def test_a_silent_stream_goes_on_elsewhere_in_asyncio_too(fake: Fake, proxy: SilentProxy):
    async with AsyncClient(motion=addresses(proxy, fake)) as client:
        session = await client.create_session()
        async with session.stream() as stream:
            sequences, gap, last = [], 0.0, time.monotonic()
            async for frame in stream.frames():
                gap, last = max(gap, time.monotonic() - last), time.monotonic()
                sequences.append(frame.sequence)
                if len(sequences) == 10:
                    proxy.silence()
                if len(fake.motions.opens) == 2 and len(sequences) > 20:
                    break
    assert sequences == list(range(1, len(sequences) + 1))
    assert gap < LONGEST_GAP


def test_calls_about_sessions_are_made_again_elsewhere(fake: Fake, proxy: SilentProxy):
    with Client(motion=addresses(proxy, fake)) as client:
        session = client.create_session()
        proxy.silence()
        assert session.steer(0, 1) == 1
        assert client.create_session().name == "sessions/2"
        session.delete()
    assert fake.motions.deleted == [session.name]


def test_a_held_session_is_not_taken_for_a_dead_one(fake: Fake, proxy: SilentProxy):
    with Client(motion=addresses(proxy, fake)) as client:
        session = client.create_session()
        stream = session.stream()
        with stream:
            items = iter(stream)
            assert isinstance(next(items), Frame)
            stream.send(controls.playback(paused=True))
            assert stream._state.patience is None
            stream.send(controls.playback(paused=False))
            assert stream._state.patience == pytest.approx(2.0)


def test_who_finds_silence_again_and_again_looks_less_often(fake: Fake, proxy: SilentProxy):
    state = Client(motion=fake.address).create_session().stream()._state
    patience = []
    for state.quiet in range(6):
        patience.append(state.patience)
    assert patience == [2, 4, 8, 16, 32, 32]


def test_a_server_that_dies_is_looked_for_and_one_that_never_was_is_not(fake: Fake, free_port: int):
    with Client(motion=f"127.0.0.1:{free_port}") as client:
        began = time.monotonic()
        with pytest.raises(ConnectionFailedError):
            client.create_session()
    assert time.monotonic() - began < 3


@pytest.mark.parametrize("duplex", [True, False])
def test_close_from_another_thread_ends_the_loop(client: Client, duplex: bool):
    session = client.create_session()
    stream = session.stream(pacing="credit", credit=3) if duplex else session.watch()
    seen: list[int] = []
    with stream:

        def read() -> None:
            seen.extend(frame.sequence for frame in stream.frames())

        reader = threading.Thread(target=read)
        reader.start()
        time.sleep(0.3)
        stream.close()
        reader.join(5)
        assert not reader.is_alive()
    assert seen


async def test_close_from_another_task_ends_the_loop(fake: Fake):
    async with AsyncClient(motion=fake.address) as client:
        session = await client.create_session()
        async with session.stream() as stream:

            async def read() -> int:
                return len([frame async for frame in stream.frames()])

            reader = asyncio.create_task(read())
            await asyncio.sleep(0.3)
            await stream.close()
            assert await asyncio.wait_for(reader, 5) > 0
