"""A real goal pose server whose registries a test may have added to before it starts."""

import json
from contextlib import asynccontextmanager

import httpx
import pytest
from roam_goalpose.app import goalpose_server
from roam_goalpose.settings import GoalPoseSettings


@pytest.fixture
def goalpose_client():
    """Starts the service with its real networks; an HTTP client of it."""

    @asynccontextmanager
    async def started():
        settings = GoalPoseSettings(isolate_uploads=False)
        async with (
            goalpose_server(settings) as addresses,
            httpx.AsyncClient(base_url=addresses.http, timeout=120) as client,
        ):
            yield client

    return started


@pytest.fixture
def ask():
    """Uploads a file and asks for a goal pose on it."""

    async def goal_pose(client: httpx.AsyncClient, data: bytes, format: str, **query: object) -> dict:
        uploaded = await client.post("/v1/objects", params={"format": format, "unit": "m", "up": "y"}, content=data)
        assert uploaded.status_code == 201, uploaded.text
        answer = await client.post("/v1/goal-poses", json={"object": uploaded.json()["name"], "action": "sit", **query})
        assert answer.status_code == 200, answer.text
        return json.loads(answer.content)

    return goal_pose
