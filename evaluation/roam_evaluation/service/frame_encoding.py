"""What a frame costs on the wire and on the processor, against one message per quaternion."""

import timeit
from collections.abc import Callable
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from roam.v1 import motion_pb2
from roam_character.skeleton import humanoid_skeleton
from roam_character.wire import pack_float32, snorm16
from roam_motion.animator import Animator, FrameData, Idle, Steer
from roam_motion.api.messages import Following, FrameFormat, pack_frame
from roam_motion.session.session import FrameRecord
from roam_serving.shipped import WEIGHTS

_ROUNDS = 200
_Field = descriptor_pb2.FieldDescriptorProto


def measure_encoding() -> dict[str, float]:
    """Bytes and microseconds of a frame, rotations only and as a whole."""
    rotations = np.random.default_rng(0).normal(size=(humanoid_skeleton().joint_count, 4)).astype(np.float32)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    positions = np.zeros((len(rotations), 3), np.float32)
    root = np.concatenate([positions[0], rotations[0]])
    data = FrameData(root, rotations, snorm16(rotations), positions, np.ones(4, bool), "sit", 0.1)
    record = FrameRecord(1000, data)
    short = FrameFormat(encoding=motion_pb2.ROTATION_ENCODING_SNORM16)
    float32 = FrameFormat()
    kind = _spelling()
    spelled = _microseconds(lambda: _spelled(kind, rotations))
    in_one = _microseconds(lambda: motion_pb2.Frame(rotations=pack_float32(rotations)).SerializeToString())
    return {
        "frame_bytes_snorm16": len(pack_frame(record, 0.1, short).SerializeToString()),
        "frame_bytes_float32": len(pack_frame(record, 0.1, float32).SerializeToString()),
        **{f"frame_bytes_delta16_{name}": size for name, size in _told_as_differences().items()},
        "frame_us_snorm16": _microseconds(lambda: pack_frame(record, 0.1, short).SerializeToString()),
        "frame_us_float32": _microseconds(lambda: pack_frame(record, 0.1, float32).SerializeToString()),
        "rotations_us_packed": in_one,
        "rotations_us_one_message_each": spelled,
        "rotations_cheaper_by": spelled / in_one,
        "rotations_bytes_one_message_each": len(_spelled(kind, rotations)),
    }


def _told_as_differences() -> dict[str, float]:
    """Bytes of a frame under DELTA16, the mean of ten seconds of people who walk and who stand."""
    animator = Animator.load(WEIGHTS / "motion.safetensors")
    found = {}
    for name, intent in (("walking", Steer(np.array([0.3, 1.0]))), ("standing", Idle())):
        state, before, sizes = animator.start((0.0, 0.0), 0.0, 1), tuple[FrameData, ...](), []
        following = Following(FrameFormat(encoding=motion_pb2.ROTATION_ENCODING_DELTA16))
        for sequence in range(1, 301):
            [(state, data)] = animator.step([state], [intent])
            record = FrameRecord(sequence, data, before)
            sizes.append(pack_frame(record, 0.1, following.of(record)).ByteSize())
            before = (data, *before[:1])
        found[name] = sum(sizes) / len(sizes)
    return found


def _spelling() -> type[Message]:
    """A frame of rotations as most protocols have it: one message with four numbers for every joint."""
    file = descriptor_pb2.FileDescriptorProto(name="spelled.proto", package="spelled", syntax="proto3")
    quaternion = file.message_type.add(name="Quaternion")
    for number, name in enumerate("xyzw", 1):
        quaternion.field.add(name=name, number=number, type=_Field.TYPE_FLOAT, label=_Field.LABEL_OPTIONAL)
    frame = file.message_type.add(name="Frame")
    rotations = frame.field.add(name="rotations", number=1, type=_Field.TYPE_MESSAGE, label=_Field.LABEL_REPEATED)
    rotations.type_name = ".spelled.Quaternion"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("spelled.Frame"))


def _spelled(kind: type[Message], rotations: np.ndarray) -> bytes:
    """The rotations in such a message."""
    frame: Any = kind()
    for x, y, z, w in rotations.tolist():
        frame.rotations.add(x=x, y=y, z=z, w=w)
    return bytes(frame.SerializeToString())


def _microseconds(function: Callable[[], object]) -> float:
    """Of the best of ten rounds: noise only adds."""
    return min(timeit.repeat(function, number=_ROUNDS, repeat=10)) / _ROUNDS * 1e6
