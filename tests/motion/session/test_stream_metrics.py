"""What /metrics tells of streams, and the log of their requests."""

import logging

import grpc
import httpx
import pytest
from roam.v1 import motion_pb2, motion_pb2_grpc
from roam_motion.session.stream import StreamOptions


@pytest.fixture
async def http(motion_addresses):
    async with httpx.AsyncClient(base_url=motion_addresses.http, timeout=30) as client:
        yield client


async def metrics(http):
    lines = [line for line in (await http.get("/metrics")).text.splitlines() if not line.startswith("#")]
    return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines)}


async def test_first_frame_intervals_and_resumes_are_counted(http, motion_addresses):
    name = (await http.post("/v1/sessions")).json()["name"]
    assert len((await http.get(f"/v1/{name}/frames", params={"count": 4})).text.splitlines()) == 5
    told = await metrics(http)
    assert told["roam_motion_first_frame_seconds_count"] == 1
    assert 0 < told["roam_motion_first_frame_seconds_sum"] < 5
    assert told["roam_motion_frame_interval_seconds_count"] == 3
    assert told.get('roam_motion_resumes_total{path="ring"}', 0) == 0

    async with grpc.aio.insecure_channel(motion_addresses.grpc) as channel:
        stub = motion_pb2_grpc.MotionServiceStub(channel)

        async def read(**opening):
            call = stub.WatchFrames(motion_pb2.WatchFramesRequest(open=motion_pb2.Open(session=name, **opening)))
            header = (await call.read()).message.header
            frame = (await call.read()).message.frame
            call.cancel()
            return header, frame

        header, frame = await read(pacing=motion_pb2.PACING_BURST)
        await read(pacing=motion_pb2.PACING_BURST, after_sequence=frame.sequence, resume_token=header.resume_token)
    told = await metrics(http)
    assert told['roam_motion_resumes_total{path="ring"}'] == 1
    assert told["roam_motion_first_frame_seconds_count"] == 3
    assert told["roam_motion_frame_interval_seconds_count"] == 3  # a reader that asks sets its own pace


async def test_skipped_frames_are_counted(http, motion_service):
    name = (await http.post("/v1/sessions")).json()["name"]
    application = motion_service._loaded()
    async with application.stream(name, StreamOptions()) as slow:
        await anext(slow)
        while slow.session.sequence < 5:
            await application.ticker.step([slow.session])
        event, frame = await anext(slow), await anext(slow)
    assert event.skipped_count >= 4
    assert frame.sequence == event.skipped_count + 1
    assert (await metrics(http))["roam_motion_frames_skipped_total"] == event.skipped_count


async def test_the_log_names_request_and_session(http, caplog):
    name = (await http.post("/v1/sessions")).json()["name"]
    with caplog.at_level(logging.INFO, "serving.http"):
        await http.get(f"/v1/{name}", headers={"X-Request-Id": "mine"})
    line = next(record.msg for record in caplog.records if record.name == "serving.http")
    assert (line["session"], line["request_id"]) == (name, "mine")
