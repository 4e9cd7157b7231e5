"""The wire format does not move: old bytes keep their meaning, new bytes equal the old ones."""

import json

import numpy as np
import pytest
from google.protobuf import json_format, symbol_database
from roam.v1 import goal_pose_pb2, motion_pb2, server_pb2, skeleton_pb2  # noqa: F401  # registers the messages
from vectors import FOLDER, description, field_at, frame, snorm16, vectors

NAMES = sorted(path.stem for path in FOLDER.glob("*.bin"))


def stored(name):
    return (FOLDER / f"{name}.bin").read_bytes(), json.loads((FOLDER / f"{name}.json").read_text())


def parsed(name):
    data, told = stored(name)
    message = symbol_database.Default().GetSymbol(told["message"])()
    message.ParseFromString(data)
    return message, told


def test_every_vector_is_stored():
    assert sorted(vectors()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_stored_bytes_decode_to_what_the_description_says(name):
    message, told = parsed(name)
    assert json_format.MessageToDict(message, preserving_proto_field_name=True) == told["fields"]
    for path, array in told["arrays"].items():
        values = np.frombuffer(field_at(message, path), {"float32": "<f4", "int16": "<i2"}[array["type"]])
        assert values.reshape(array["shape"]).tolist() == array["values"]


@pytest.mark.parametrize("name", NAMES)
def test_todays_code_writes_the_stored_bytes(name):
    data, told = stored(name)
    vector = vectors()[name]
    assert vector.message.SerializeToString(deterministic=True) == data
    assert description(vector) == told


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_field_is_skipped(name):
    message, _ = parsed(name)
    data, _ = stored(name)
    later = type(message)()
    later.ParseFromString(data + b"\xfa\x7f\x03new")  # field 2047, length 3: from a newer server
    later.DiscardUnknownFields()
    assert later == message


def test_frames_have_the_sizes_that_the_readme_states():
    sizes = {}
    for joints in (22, 25):
        turned = np.tile(np.array([0.5, -0.5, 0.5, 0.5], "<f4"), (joints, 1))
        for kind, packed in (("float32", turned.tobytes()), ("snorm16", snorm16(turned))):
            sizes[joints, kind] = frame(packed).ByteSize()
    readme = (FOLDER.parent / "README.md").read_text()
    for (joints, kind), size in sizes.items():
        assert f"| {joints} | {kind} | {size} |" in readme


def test_snorm16_is_as_exact_as_the_readme_states():
    rng = np.random.default_rng(0)
    rotations = rng.normal(size=(100_000, 4))
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    read = np.frombuffer(snorm16(rotations), "<i2").reshape(-1, 4) / 32767
    read /= np.linalg.norm(read, axis=-1, keepdims=True)
    dot = np.abs(np.sum(read * rotations, -1)).clip(max=1)
    # an arc cosine near 1 is no measure in floating point; the chord is
    chord = np.minimum(np.linalg.norm(read - rotations, axis=-1), np.linalg.norm(read + rotations, axis=-1))
    assert dot.min() > 0.999999
    assert np.degrees(4 * np.arcsin(chord.max() / 2)) < 0.0055
