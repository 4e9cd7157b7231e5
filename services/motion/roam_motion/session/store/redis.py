"""The session store of several replicas: one hash per session in Redis.

    roam:session:{name}   record, key, owner, token; s:{sequence} snapshots, c:{effective} controls;
                          v:{digest} the furniture of those, each once, named in us:{sequence} and uc:{effective}
    roam:request:{key}:{id}   name of the session that a request_id made
    roam:lease:{owner}    there while the replica lives
    roam:asked:{owner}    sessions that others ask it for

Every change checks the token where it is made, in a script that Redis runs as one step. One Redis, not a cluster.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from redis.asyncio import Redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError, ResponseError
from roam_character.volume import Volume

from roam_motion.session.records import Claim, ControlEntry, SessionRecord, Snapshot, volumes_of
from roam_motion.session.store.base import HeldElsewhereError, MissingError, StoreDownError, SupersededError
from roam_motion.session.store.codec import RecordCodec

_TIMEOUT = 0.5  # [s] for one answer
_TOMBSTONE = 60_000  # [ms] that a removed session keeps fencing replicas that have not heard of it
_ROOM = 0.8  # share of Redis' memory from which on only the sessions that are there may grow
_ASKED = 5_000  # [ms] after which a question is forgotten

_CREATE = """
if KEYS[2] ~= '' then
  local known = redis.call('GET', KEYS[2])
  if known and redis.call('HEXISTS', 'roam:session:' .. known, 'record') == 1 then return known end
  redis.call('SET', KEYS[2], ARGV[1])
end
redis.call('HSET', KEYS[1], 'record', ARGV[2], 'owner', ARGV[3], 'token', 1, 's:0', ARGV[4], 'key', ARGV[6])
redis.call('PEXPIRE', KEYS[1], ARGV[5])
if KEYS[2] ~= '' then redis.call('PEXPIRE', KEYS[2], ARGV[5]) end
return ARGV[1]
"""
_CLAIM = """
local held = redis.call('HMGET', KEYS[1], 'record', 'owner', 'key')
if not held[1] or held[3] ~= ARGV[2] then return nil end
if held[2] ~= ARGV[1] and redis.call('EXISTS', 'roam:lease:' .. held[2]) == 1 then return held[2] end
redis.call('HINCRBY', KEYS[1], 'token', 1)
local found = redis.call('HGETALL', KEYS[1])
redis.call('HSET', KEYS[1], 'owner', ARGV[1])
return found
"""
_LOG = """
local token = redis.call('HGET', KEYS[1], 'token')
if not token then return 'missing' end
if token ~= ARGV[1] then return 'superseded' end
redis.call('HSET', KEYS[1], 'c:' .. ARGV[2], ARGV[3], 'uc:' .. ARGV[2], ARGV[4])
for i = 5, #ARGV, 2 do redis.call('HSETNX', KEYS[1], ARGV[i], ARGV[i + 1]) end
return 'ok'
"""
_SAVE = """
local token = redis.call('HGET', KEYS[1], 'token')
if token and token ~= ARGV[1] then return 'superseded' end
if not token then
  redis.call('HSET', KEYS[1], 'record', ARGV[4], 'owner', ARGV[5], 'token', ARGV[1], 'key', ARGV[8])
  redis.call('PEXPIRE', KEYS[1], ARGV[6])
end
redis.call('HSET', KEYS[1], 's:' .. ARGV[2], ARGV[3], 'us:' .. ARGV[2], ARGV[9])
for i = 10, #ARGV, 2 do redis.call('HSETNX', KEYS[1], ARGV[i], ARGV[i + 1]) end
local from, used, volumes = tonumber(ARGV[7]), {}, {}
for _, key in ipairs(redis.call('HKEYS', KEYS[1])) do
  local kind, number = string.match(key, '^(u?[sc]):(%d+)$')
  number = tonumber(number)
  if number and (number < from or (number == from and string.sub(kind, -1) == 'c')) then
    redis.call('HDEL', KEYS[1], key)
  elseif kind == 'us' or kind == 'uc' then
    for digest in string.gmatch(redis.call('HGET', KEYS[1], key), '%x+') do used['v:' .. digest] = true end
  elseif string.sub(key, 1, 2) == 'v:' then
    volumes[#volumes + 1] = key
  end
end
for _, key in ipairs(volumes) do
  if not used[key] then redis.call('HDEL', KEYS[1], key) end
end
return 'ok'
"""
_RELEASE = """
if redis.call('HGET', KEYS[1], 'token') == ARGV[1] then redis.call('HSET', KEYS[1], 'owner', '') end
"""
_REMOVE = """
if redis.call('HGET', KEYS[1], 'token') ~= ARGV[1] then return end
redis.call('DEL', KEYS[1])
redis.call('HSET', KEYS[1], 'token', ARGV[1] + 1)
redis.call('PEXPIRE', KEYS[1], ARGV[2])
"""


class RedisStore:
    """Implements `SessionStore` on one Redis."""

    def __init__(self, redis: Redis, codec: RecordCodec) -> None:
        self._redis, self._codec = redis, codec
        self.nearly_full = False
        self._create = redis.register_script(_CREATE)
        self._claim = redis.register_script(_CLAIM)
        self._log = redis.register_script(_LOG)
        self._save = redis.register_script(_SAVE)
        self._release = redis.register_script(_RELEASE)
        self._remove = redis.register_script(_REMOVE)

    @staticmethod
    def at(url: str, codec: RecordCodec) -> "RedisStore":
        """The store behind an address such as redis://localhost:6379/0; connects when it is first needed."""
        retry = Retry(NoBackoff(), 1)  # once, for a connection that Redis closed in the meantime
        redis = Redis.from_url(url, socket_timeout=_TIMEOUT, socket_connect_timeout=_TIMEOUT, retry=retry)
        return RedisStore(redis, codec)

    async def renew(self, owner: str, seconds: float) -> None:
        """See `SessionStore`."""
        with _down():
            await self._redis.set(f"roam:lease:{owner}", 1, px=_milliseconds(seconds))
            await self._look_for_room()

    async def _look_for_room(self) -> None:
        try:
            memory = await self._redis.info("memory")
        except ResponseError:  # one that may not be asked
            return
        most = int(memory.get("maxmemory", 0))
        self.nearly_full = most > 0 and int(memory["used_memory"]) > _ROOM * most

    async def create(self, record: SessionRecord, owner: str, snapshot: Snapshot) -> str:
        """See `SessionStore`."""
        request = f"roam:request:{record.owner}:{record.request_id}" if record.request_id else ""
        encode, kept = self._codec.encode, _milliseconds(record.idle_timeout)
        values = [record.name, encode(record), owner, encode(snapshot), kept, record.owner]
        return str((await self._run(self._create, [_key(record.name), request], values)).decode())

    async def claim(self, name: str, owner: str, key: str = "") -> Claim | None:
        """See `SessionStore`."""
        found = await self._run(self._claim, [_key(name)], [owner, key])
        if found is None:
            return None
        if isinstance(found, bytes):
            raise HeldElsewhereError(found.decode())
        fields = {key.decode(): value for key, value in zip(found[::2], found[1::2], strict=True)}
        packed = {key[2:]: value for key, value in fields.items() if key.startswith("v:")}
        volumes = {digest: Volume.unpacked(value) for digest, value in packed.items()}
        snapshots = [self._codec.snapshot(value, volumes) for key, value in fields.items() if key.startswith("s:")]
        controls = [self._codec.control(value, volumes) for key, value in fields.items() if key.startswith("c:")]
        return Claim(
            self._codec.record(fields["record"]),
            int(fields["token"]),
            tuple(sorted(snapshots, key=lambda snapshot: snapshot.sequence)),
            tuple(sorted(controls, key=lambda entry: entry.effective)),
            released=not fields["owner"],
        )

    async def log(self, name: str, token: int, entry: ControlEntry) -> None:
        """See `SessionStore`."""
        used, furniture = _furniture(volumes_of(entry.change))
        values = [token, entry.effective, self._codec.encode(entry), used, *furniture]
        _judge(await self._run(self._log, [_key(name)], values))

    async def save(self, record: SessionRecord, owner: str, token: int, snapshot: Snapshot, keep_from: int) -> None:
        """See `SessionStore`."""
        encode = self._codec.encode
        terms = [encode(record), owner, _milliseconds(record.idle_timeout)]
        used, furniture = _furniture(snapshot.volumes)
        values = [token, snapshot.sequence, encode(snapshot), *terms, keep_from, record.owner, used, *furniture]
        _judge(await self._run(self._save, [_key(record.name)], values))

    async def release(self, name: str, token: int) -> None:
        """See `SessionStore`."""
        await self._run(self._release, [_key(name)], [token])

    async def remove(self, name: str, token: int) -> None:
        """See `SessionStore`. A tombstone goes on fencing for a minute."""
        await self._run(self._remove, [_key(name)], [token, _TOMBSTONE])

    async def keep(self, seconds: Mapping[str, float]) -> set[str]:
        """See `SessionStore`."""
        with _down():
            async with self._redis.pipeline(transaction=False) as pipe:
                for name, kept in seconds.items():
                    pipe.pexpire(_key(name), _milliseconds(kept))
                found = await pipe.execute()
        return {name for name, there in zip(seconds, found, strict=True) if not there}

    async def ask(self, owner: str, name: str) -> None:
        """See `SessionStore`."""
        with _down():
            async with self._redis.pipeline() as pipe:
                pipe.sadd(f"roam:asked:{owner}", name)
                pipe.pexpire(f"roam:asked:{owner}", _ASKED)
                await pipe.execute()

    async def asked(self, owner: str) -> set[str]:
        """See `SessionStore`."""
        with _down():
            async with self._redis.pipeline() as pipe:
                pipe.smembers(f"roam:asked:{owner}")
                pipe.delete(f"roam:asked:{owner}")
                names, _ = await pipe.execute()
        return {name.decode() for name in names}

    async def close(self) -> None:
        """See `SessionStore`."""
        await self._redis.aclose()

    async def _run(self, script: Any, keys: Sequence[str], values: Sequence[Any]) -> Any:
        with _down():
            return await script(keys=keys, args=values)


def _key(name: str) -> str:
    return f"roam:session:{name}"


def _furniture(volumes: Sequence[Volume]) -> tuple[str, list[Any]]:
    """The digests of some volumes, and the fields that keep them."""
    fields: list[Any] = []
    for volume in volumes:
        fields += [f"v:{volume.digest}", volume.packed]
    return " ".join(volume.digest for volume in volumes), fields


def _milliseconds(seconds: float) -> int:
    return max(1, round(seconds * 1000))


def _judge(answer: bytes) -> None:
    if answer == b"superseded":
        raise SupersededError
    if answer == b"missing":
        raise MissingError


@contextmanager
def _down() -> Iterator[None]:
    try:
        yield
    except (RedisError, OSError, TimeoutError) as error:
        raise StoreDownError(str(error)) from error
