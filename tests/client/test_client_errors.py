import grpc
import pytest
from fake_services import Fake
from roam_client import (
    AsyncClient,
    Client,
    ConnectionFailedError,
    InvalidRequestError,
    NotFoundError,
    RequestTimeoutError,
    RoamError,
    ServerError,
    UnavailableError,
)
from roam_client import errors as module


def test_the_tree_in_the_docstring_is_the_tree_in_the_code():
    names = [name for name, item in vars(module).items() if isinstance(item, type) and issubclass(item, RoamError)]
    assert module.__doc__ is not None
    drawn = [line.split("── ")[1].split()[0] for line in module.__doc__.splitlines() if "── " in line]
    assert sorted(drawn) == sorted(set(names) - {"RoamError"})


def test_the_servers_table_arrives_with_reason_remedy_and_field(client: Client):
    with pytest.raises(InvalidRequestError) as caught:
        client.upload(b"bad", format="obj")
    error = caught.value
    assert (error.reason, error.remedy) == ("OBJECT_EMPTY", "export the mesh again")
    assert error.code is grpc.StatusCode.INVALID_ARGUMENT
    assert [(f.field, f.description) for f in error.fields] == [("chunk", "the file has no faces")]
    assert str(error) == "the file has no faces (OBJECT_EMPTY)"


def test_a_missing_thing_is_not_found(client: Client):
    with pytest.raises(NotFoundError, match="OBJECT_NOT_FOUND"):
        client.object("objects/sha256:other")
    with pytest.raises(NotFoundError, match="SESSION_NOT_FOUND"):
        client.session("sessions/none")


def test_a_full_queue_says_when_to_come_back(client: Client):
    with pytest.raises(UnavailableError) as caught:
        client.synthesize("objects/sha256:abc", solver="busy")
    assert caught.value.retry_after == 3


def test_no_server_names_the_address(free_port: int):
    with (
        Client(goalpose=f"127.0.0.1:{free_port}") as client,
        pytest.raises(ConnectionFailedError, match=str(free_port)),
    ):
        client.reference_poses()


def test_a_client_without_an_address_says_which_one_is_missing():
    with Client(goalpose="127.0.0.1:1") as client, pytest.raises(RoamError, match="motion='host:port'"):
        client.create_session()


def test_too_short_a_time_is_a_timeout(fake: Fake):
    fake.goal_poses.slow.set()
    with Client(goalpose=fake.address, timeout=0.1) as client, pytest.raises(RequestTimeoutError, match=fake.address):
        client.reference_poses()


async def test_the_async_twin_raises_the_same(fake: Fake):
    async with AsyncClient(goalpose=fake.address, motion=fake.address) as client:
        with pytest.raises(InvalidRequestError) as caught:
            await client.upload(b"bad", format="obj")
        assert caught.value.remedy == "export the mesh again"
        with pytest.raises(NotFoundError):
            await client.session("sessions/none")
        with pytest.raises(ServerError, match="REFERENCE_POSE_NOT_FOUND"):
            await client.synthesize("objects/sha256:abc", reference="nobody")
