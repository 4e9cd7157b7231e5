"""A Redis and a pool of replicas, of which every test may kill one."""

import pytest
from replicas import REDIS, Redis, Replica, address, ended_with_the_block, start_motion
from roam_motion.app import SHIPPED_WEIGHTS


@pytest.fixture(scope="session")
def redis(tmp_path_factory):
    """A real Redis."""
    if REDIS is None:
        pytest.skip("needs redis-server: apt-get install redis-server")
    redis = Redis(tmp_path_factory.mktemp("redis"))
    yield redis
    redis.stop()


@pytest.fixture(scope="session")
def pool(redis):
    """Replicas that still live; started together, because starting is what takes long."""
    if not SHIPPED_WEIGHTS.exists():
        pytest.skip("weights/motion.safetensors is not there")
    processes = [start_motion(redis.url) for _ in range(4)]
    with ended_with_the_block(*processes):
        yield [Replica(process, address(process)) for process in processes]


@pytest.fixture
def pair(pool):
    """Two replicas; the test may end the first."""
    first, second = pool[0], pool[1]
    yield first, second
    if first.process.poll() is not None:
        pool.remove(first)
