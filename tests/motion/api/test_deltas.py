"""DELTA16: the numbers of SNORM16 to the bit, whatever a stream skips, in little more than half the bytes."""

from collections.abc import Sequence

import numpy as np
import pytest
from roam.v1 import motion_pb2
from roam_character.skeleton import humanoid_skeleton
from roam_character.wire import snorm16
from roam_client.connection.deltas import DeltaReader
from roam_client.errors import WireError
from roam_motion.animator import FrameData
from roam_motion.api.deltas import pack_deltas
from roam_motion.api.messages import Following, FrameFormat, frame_message
from roam_motion.session.session import FrameRecord

JOINTS = humanoid_skeleton().joint_count
DELTA16, SNORM16 = motion_pb2.ROTATION_ENCODING_DELTA16, motion_pb2.ROTATION_ENCODING_SNORM16


def turning(count: int, seed: int, joints: int = JOINTS) -> np.ndarray:
    """Rotations [N, J, 4] that turn evenly, some of them through a change of sign, as SNORM16 has them."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(joints, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = rng.normal(size=joints) + np.cumsum(0.02 * rng.normal(size=(count, joints)), 0)
    whole = np.concatenate([axes * np.sin(angles)[..., None], np.cos(angles)[..., None]], -1)
    signs = np.where(rng.random((count, joints, 1)) < 0.02, -1.0, 1.0)
    return snorm16((whole * signs).astype(np.float32))


def records(shorts: np.ndarray) -> list[FrameRecord]:
    """As a session makes them."""
    made: list[FrameData] = []
    found = []
    for number, short in enumerate(shorts, start=1):
        rotations = short.astype(np.float32) / 32767
        root = np.concatenate([np.float32([0.5, 0.9, -1.0]), rotations[0]])
        data = FrameData(root, rotations, short, np.zeros((len(short), 3), np.float32), np.ones(4, bool), "walk", None)
        found.append(FrameRecord(number, data, tuple(made[:-3:-1])))
        made.append(data)
    return found


def sent(frames: Sequence[FrameRecord], encoding: int = DELTA16) -> list[motion_pb2.Frame]:
    following = Following(FrameFormat(encoding))
    return [frame_message(frame, 0.0, following.of(frame)).frame for frame in frames]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("joints", [JOINTS, 3])
def test_the_reader_has_the_numbers_of_snorm16(seed: int, joints: int) -> None:
    shorts = turning(40, seed, joints)
    reader = DeltaReader(joints)
    for frame, short in zip(sent(records(shorts)), shorts, strict=True):
        assert reader.read(frame.rotations) == short.tobytes()


def test_any_numbers_come_through() -> None:
    rng = np.random.default_rng(0)
    before: list[np.ndarray] = []
    reader = DeltaReader(JOINTS)
    for _ in range(50):
        short = rng.integers(-32768, 32768, (JOINTS, 4)).astype(np.int16)
        assert reader.read(pack_deltas(short, before)) == short.tobytes()
        before = [short, *before[:1]]


def test_what_follows_skipped_frames_looks_back_at_none_of_them() -> None:
    shorts = turning(30, 1)
    kept = [frame for frame in records(shorts) if frame.sequence not in (7, 8, 15)]
    reader = DeltaReader(JOINTS)
    told = sent(kept)
    for frame, record in zip(told, kept, strict=True):
        assert reader.read(frame.rotations) == record.data.snorm16.tobytes()
    looks = {frame.sequence: frame.rotations[0] for frame in told}
    assert [looks[n] for n in (1, 2, 3, 6, 9, 10, 11, 16, 17, 18)] == [0, 1, 2, 2, 0, 1, 2, 0, 1, 2]


def test_a_frame_is_much_smaller_and_a_still_one_costs_nearly_nothing() -> None:
    shorts = turning(200, 2)
    small, large = (sum(frame.ByteSize() for frame in sent(records(shorts), one)) for one in (DELTA16, SNORM16))
    assert small < 0.75 * large  # of noise; what people do is smoother
    still = sent(records(np.repeat(shorts[:1], 5, 0)))
    assert still[-1].ByteSize() < 0.2 * sent(records(shorts[:1]), SNORM16)[0].ByteSize()


def test_readers_of_one_session_share_what_is_alike() -> None:
    frames = records(turning(6, 3))
    one, other = Following(FrameFormat(DELTA16)), Following(FrameFormat(DELTA16))
    for frame in frames[:3]:
        one.of(frame)
    for frame in frames[3:]:
        assert one.of(frame).seen == 2
    assert [other.of(frame).seen for frame in frames[3:]] == [0, 1, 2]
    first = frame_message(frames[5], 0.0, FrameFormat(DELTA16, seen=2))
    assert frame_message(frames[5], 0.0, FrameFormat(DELTA16, seen=2)) is first


@pytest.mark.parametrize("data", [b"", b"\1", b"\2" + bytes(40), b"\3" + bytes(176), b"\0" + bytes(175)])
def test_bytes_that_are_no_frame_are_refused(data: bytes) -> None:
    with pytest.raises(WireError):
        DeltaReader(JOINTS).read(data)


def test_a_frame_that_was_cut_short_is_refused() -> None:
    shorts = turning(2, 4)
    reader = DeltaReader(JOINTS)
    reader.read(pack_deltas(shorts[0], []))
    with pytest.raises(WireError):
        reader.read(pack_deltas(shorts[1], [shorts[0]])[:-1])
