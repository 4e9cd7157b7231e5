"""Rates that several replicas count together in one Redis, and what holds while it does not answer."""

import pytest
from fakeredis import FakeAsyncRedis, FakeServer
from roam_serving.errors import ServiceError
from roam_serving.shared_rates import SharedRateLimiter

SLOW = 1e-3  # [1/s] no token comes back during a test


@pytest.fixture
def server():
    return FakeServer()


@pytest.fixture
def replicas(server):
    return [SharedRateLimiter(FakeAsyncRedis(server=server), SLOW, 4) for _ in range(2)]


async def taken(replicas, caller, times):
    """How often the replicas in turn let a caller in."""
    refusals = []
    for number in range(times):
        try:
            await replicas[number % len(replicas)].take(caller)
        except ServiceError as error:
            refusals.append(error)
    assert {error.kind.reason for error in refusals} <= {"RATE_LIMITED"}
    assert all(error.retry_after > 0 for error in refusals)
    return times - len(refusals)


async def test_requests_count_whichever_replica_they_reach(replicas):
    assert await taken(replicas, "studio", 12) == 4
    assert await taken(replicas, "another", 3) == 3


async def test_tokens_come_back_with_time(server):
    quick = SharedRateLimiter(FakeAsyncRedis(server=server), 1e6, 1)
    assert await taken([quick], "studio", 20) == 20


async def test_without_redis_each_replica_counts_alone(replicas, server):
    server.connected = False
    assert await taken(replicas, "studio", 12) == 8


async def test_redis_counts_again_once_it_is_back(server):
    now = 0.0
    replicas = [SharedRateLimiter(FakeAsyncRedis(server=server), SLOW, 4, lambda: now) for _ in range(2)]
    server.connected = False
    assert await taken(replicas, "studio", 2) == 2
    server.connected = True
    now = 60.0
    assert await taken(replicas, "studio", 12) == 4
