"""What a gateway that routes by session relies on: ids that it makes, sessions that come home."""

import grpc
import httpx
import pytest
from roam.v1 import motion_pb2, motion_pb2_grpc
from roam_motion.settings import MotionSettings
from roam_serving.server import running

OFFERED = "0b7c5a52-6f5e-4a55-9a5b-3f0d5f6b0c01"


async def created(addresses, offered):
    """Names of a session made over HTTP and of one over gRPC, both offered an id."""
    async with (
        httpx.AsyncClient(base_url=addresses.http, timeout=30) as client,
        grpc.aio.insecure_channel(addresses.grpc) as channel,
    ):
        answer = await client.post("/v1/sessions", headers={"x-roam-session": offered})
        over_http = answer.json()["name"]
        await client.delete(f"/v1/{over_http}")
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        metadata = (("x-roam-session", offered),)
        session = (await stub.CreateSession(motion_pb2.CreateSessionRequest(), metadata=metadata)).session
    return over_http, session.name


@pytest.fixture
async def behind_a_gateway(motion_service):
    settings = MotionSettings(
        session_header=True, step_process=False, motion_weights=motion_service._settings.motion_weights
    )
    motion_service._settings = settings
    async with running([motion_service], settings) as addresses:
        yield addresses


async def test_a_new_session_takes_the_id_that_the_gateway_made(behind_a_gateway):
    assert await created(behind_a_gateway, OFFERED) == (f"sessions/{OFFERED}", f"sessions/{OFFERED}")


@pytest.mark.parametrize("offered", ["mine", OFFERED.upper(), OFFERED + "0", "../" + OFFERED])
async def test_an_id_that_no_gateway_makes_is_not_taken(behind_a_gateway, offered):
    assert all(offered not in name for name in await created(behind_a_gateway, offered))


async def test_without_a_gateway_nobody_chooses_ids(motion_addresses):
    assert all(OFFERED not in name for name in await created(motion_addresses, OFFERED))
