"""The bounded queue of heavy work, and the cache beside it."""

import asyncio
import threading

import pytest
from prometheus_client import CollectorRegistry
from roam_serving.cache import RecentCache
from roam_serving.compute import ComputeQueue
from roam_serving.errors import QUEUE_FULL, ServiceError


async def test_refuses_beyond_its_limit_and_recovers():
    queue = ComputeQueue("jobs", limit=2, registry=CollectorRegistry())
    gate = threading.Event()
    jobs = [asyncio.create_task(queue.run(gate.wait)) for _ in range(2)]
    await asyncio.sleep(0)
    with pytest.raises(ServiceError) as caught:
        await queue.run(gate.wait)
    assert caught.value.kind is QUEUE_FULL
    assert caught.value.retry_after is not None
    assert caught.value.retry_after >= 1
    gate.set()
    assert await asyncio.gather(*jobs) == [True, True]
    while queue.pending:
        await asyncio.sleep(0)
    assert await queue.run(lambda: 7) == 7


async def test_a_cancelled_waiting_job_never_runs():
    queue = ComputeQueue("jobs", limit=5, registry=CollectorRegistry())
    gate, ran = threading.Event(), []
    first = asyncio.create_task(queue.run(gate.wait))
    second = asyncio.create_task(queue.run(lambda: ran.append(1)))
    await asyncio.sleep(0)
    second.cancel()
    with pytest.raises(asyncio.CancelledError):
        await second
    gate.set()
    await first
    assert await queue.run(lambda: list(ran)) == []


async def test_errors_come_back():
    queue = ComputeQueue("jobs", limit=1, registry=CollectorRegistry())
    with pytest.raises(ZeroDivisionError):
        await queue.run(lambda: 1 // 0)


def test_the_cache_forgets_the_least_recent():
    cache = RecentCache[str, int](2)
    cache.put("a", 1)
    cache.put("b", 2)
    assert cache.get("a") == 1
    cache.put("c", 3)
    assert (cache.get("a"), cache.get("b"), cache.get("c"), len(cache)) == (1, None, 3, 2)
