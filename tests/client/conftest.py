import socket
from collections.abc import Iterator

import pytest
from fake_services import Fake, fake_services
from roam_client import Client


@pytest.fixture
def fake() -> Iterator[Fake]:
    with fake_services() as running:
        yield running


@pytest.fixture
def client(fake: Fake) -> Iterator[Client]:
    with Client(goalpose=fake.address, motion=fake.address) as connected:
        yield connected


@pytest.fixture
def free_port() -> int:
    """A port of this machine on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
