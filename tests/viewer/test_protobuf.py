"""The page's own reader and writer of protocol buffers against the real ones."""

import base64
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from roam.v1 import motion_pb2, skeleton_pb2
from roam_motion.api.deltas import pack_deltas

GOLDEN = Path(__file__).parents[2] / "proto/golden"
VIEWER = Path(__file__).parents[2] / "clients/python/roam_command/viewer"

SCRIPT = """
import { readFileSync } from "node:fs";
const [folder] = process.argv.slice(1);
const { decode, encode, floats, snorm16, packFloats } = await import(`${folder}/protobuf.js`);
const messages = await import(`${folder}/messages.js`);
const jobs = JSON.parse(readFileSync(0, "utf8"));
const plain = (_, value) => (value instanceof Uint8Array ? Buffer.from(value).toString("base64") : value);
const run = ({ kind, data, message, values }) => {
  if (values) return Buffer.from(packFloats(values)).toString("base64");
  if (message) return Buffer.from(encode(messages[kind], message)).toString("base64");
  const bytes = new Uint8Array(Buffer.from(data, "base64"));
  if (kind === "floats") return [...floats(bytes)];
  if (kind === "snorm16") return [...snorm16(bytes)];
  try {
    return JSON.parse(JSON.stringify(decode(messages[kind], bytes), plain));
  } catch (error) {
    return { error: error.message };
  }
};
console.log(JSON.stringify(jobs.map(run)));
"""


def in_node(*jobs: dict[str, Any]) -> list[Any]:
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node to run the page's scripts outside a browser")
    done = subprocess.run(
        [node, "--input-type=module", "-e", SCRIPT, "--", str(VIEWER)],
        input=json.dumps(jobs),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def encoded(message: Any) -> str:
    return base64.b64encode(message.SerializeToString()).decode()


def test_every_kind_of_answer_is_read():
    skeleton = skeleton_pb2.Skeleton(
        id="sha256:ä",
        joint_names=["hips", "spine"],
        parents=[-1, 0],
        rest_offsets=b"\0\1",
        tips=[skeleton_pb2.Tip(name="head", joint=1, offset=[0.5, -1, 0])],
    )
    header = motion_pb2.StreamHeader(
        session="sessions/1",
        skeleton=skeleton,
        rotation_encoding=motion_pb2.ROTATION_ENCODING_SNORM16,
        frame_rate=30,
        first_sequence=7,
        discontinuity=True,
        contact_joints=[0, 300],
        last_control_id=1 << 40,
    )
    frame = motion_pb2.Frame(
        sequence=4_000_000_000, time=1.5, root=b"abc", rotations=b"\xff", contacts=5, action=3, goal_distance=0.25
    )
    event = motion_pb2.SessionEvent(
        type=motion_pb2.EVENT_TYPE_FRAMES_SKIPPED, sequence=9, message="ü", skipped_count=200
    )
    answers = in_node(
        {"kind": "AnimateResponse", "data": encoded(motion_pb2.AnimateResponse(header=header))},
        {"kind": "AnimateResponse", "data": encoded(motion_pb2.AnimateResponse(frame=frame))},
        {"kind": "AnimateResponse", "data": encoded(motion_pb2.AnimateResponse(event=event))},
    )
    read = answers[0]["header"]
    assert read["skeleton"]["parents"] == [-1, 0]
    assert read["skeleton"]["id"] == "sha256:ä"
    assert read["skeleton"]["joint_names"] == ["hips", "spine"]
    assert read["skeleton"]["tips"] == [{"name": "head", "joint": 1, "offset": [0.5, -1, 0]}]
    assert read["contact_joints"] == [0, 300]
    assert (read["discontinuity"], read["last_control_id"], read["first_sequence"]) == (True, 1 << 40, 7)
    assert answers[1]["frame"] == {
        "sequence": 4_000_000_000,
        "time": 1.5,
        "root": "YWJj",
        "rotations": "/w==",
        "contacts": 5,
        "action": 3,
        "goal_distance": 0.25,
    }
    assert answers[2]["event"] == {"type": 2, "sequence": 9, "message": "ü", "skipped_count": 200}


def test_fields_of_a_newer_server_are_skipped_and_cut_messages_are_refused():
    # an event has a Duration (field 4) that the page does not read
    event = motion_pb2.SessionEvent(type=motion_pb2.EVENT_TYPE_DRAINING, sequence=3)
    event.reconnect_within.FromSeconds(5)
    whole = motion_pb2.AnimateResponse(event=event)
    whole.echo_client_time.GetCurrentTime()
    cut = base64.b64encode(whole.SerializeToString()[:4]).decode()
    read, refused = in_node(
        {"kind": "AnimateResponse", "data": encoded(whole)}, {"kind": "AnimateResponse", "data": cut}
    )
    assert read["event"] == {"type": 3, "sequence": 3}
    assert "ends inside" in refused["error"]


def test_what_the_page_writes_is_what_the_server_reads():
    controls = [
        {"control": {"steer": {"velocity_x": -1.5, "velocity_z": 0, "facing": 0.5, "action": 1}, "control_id": 300}},
        {"control": {"goal": {"goal_pose": "g", "pose": {"skeleton_id": "s"}, "action": 4}, "control_id": 1}},
        {"control": {"playback": {"paused": True}, "control_id": 2}},
        {"open": {"session": "sessions/x", "after_sequence": 5, "rotation_encodings": [2, 1], "pacing": 1}},
        {"ack": {"sequence": 77, "credit": 2}},
    ]
    answers = in_node(*({"kind": "AnimateRequest", "message": message} for message in controls))
    read = [motion_pb2.AnimateRequest.FromString(base64.b64decode(answer)) for answer in answers]
    steer = read[0].control.steer
    assert (steer.velocity_x, steer.velocity_z, steer.facing, steer.action) == (-1.5, 0, 0.5, skeleton_pb2.ACTION_IDLE)
    assert steer.HasField("facing")
    assert read[0].control.control_id == 300
    assert (read[1].control.goal.goal_pose, read[1].control.goal.action) == ("g", skeleton_pb2.ACTION_LIE)
    assert read[1].control.goal.pose.skeleton_id == "s"
    assert read[2].control.playback.paused
    assert list(read[3].open.rotation_encodings) == [2, 1]
    assert (read[3].open.session, read[3].open.after_sequence) == ("sessions/x", 5)
    assert (read[4].ack.sequence, read[4].ack.credit) == (77, 2)


def test_arrays_are_packed_alike():
    values = np.array([[0.0, 1.5], [-2.25, 1e-3]], np.float32)
    shorts = np.array([32767, -32767, 0, 1], "<i2")
    packed, floats, fractions = in_node(
        {"values": values.tolist()},
        {"kind": "floats", "data": base64.b64encode(values.tobytes()).decode()},
        {"kind": "snorm16", "data": base64.b64encode(shorts.tobytes()).decode()},
    )
    assert base64.b64decode(packed) == values.astype("<f4").tobytes()
    np.testing.assert_array_equal(np.array(floats, np.float32), values.ravel())
    np.testing.assert_allclose(fractions, shorts / 32767, atol=1e-7)


def golden(kind: str) -> dict[str, tuple[bytes, dict[str, Any]]]:
    """The shared vectors of one message: name -> bytes and description."""
    found = {
        path.stem: (path.read_bytes(), json.loads(path.with_suffix(".json").read_text()))
        for path in GOLDEN.glob("*.bin")
    }
    return {name: pair for name, pair in found.items() if pair[1]["message"].endswith(kind)}


def test_the_golden_answers_are_read():
    vectors = golden("AnimateResponse")
    assert len(vectors) >= 4
    jobs = [{"kind": "AnimateResponse", "data": base64.b64encode(data).decode()} for data, _ in vectors.values()]
    for answer, (data, told) in zip(in_node(*jobs), vectors.values(), strict=True):
        expected = motion_pb2.AnimateResponse.FromString(data)
        kind = expected.WhichOneof("message")
        for descriptor, value in getattr(expected, kind).ListFields():
            if descriptor.type in (descriptor.TYPE_MESSAGE, descriptor.TYPE_BYTES):
                continue
            assert answer[kind][descriptor.name] == (
                value if isinstance(value, str | bool | int | float) else list(value)
            )
        for path, array in told["arrays"].items():
            read: Any = answer
            for part in path.split("."):
                read = read[part]
            numbers = np.frombuffer(base64.b64decode(read), {"float32": "<f4", "int16": "<i2"}[array["type"]])
            assert numbers.reshape(array["shape"]).tolist() == array["values"]


def test_the_golden_requests_are_written_bit_for_bit():
    requests = {
        "control_pause": {"control": {"playback": {"paused": True}, "control_id": 201}},
        "control_steer": {
            "control": {"steer": {"velocity_x": 1.25, "velocity_z": -0.5, "facing": 0}, "control_id": 200}
        },
        "ack": {"ack": {"sequence": 90, "credit": 1}},
    }
    vectors = golden("AnimateRequest")
    written = in_node(*({"kind": "AnimateRequest", "message": message} for message in requests.values()))
    for name, data in zip(requests, written, strict=True):
        assert base64.b64decode(data) == vectors[name][0], name


DELTAS = """
import { readFileSync } from "node:fs";
const [folder] = process.argv.slice(1);
const { DeltaReader } = await import(`${folder}/deltas.js`);
const reader = new DeltaReader();
const frames = JSON.parse(readFileSync(0, "utf8")).map((data) => new Uint8Array(Buffer.from(data, "base64")));
console.log(JSON.stringify(frames.map((bytes) => [...reader.read(bytes)])));
"""


def test_the_page_reads_differences_as_the_python_client_does():
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node to run the page's scripts outside a browser")
    rng = np.random.default_rng(0)
    steady = rng.integers(-9000, 9000, (3, 4)) + np.arange(20)[:, None, None] * rng.integers(-50, 50, (3, 4))
    wanted = [*steady.astype(np.int16), *rng.integers(-32768, 32768, (5, 3, 4)).astype(np.int16)]
    before: list[np.ndarray] = []
    sent = []
    for rotations in wanted:
        sent.append(base64.b64encode(pack_deltas(rotations, before)).decode())
        before = [rotations, *before[:1]]
    done = subprocess.run(
        [node, "--input-type=module", "-e", DELTAS, "--", str(VIEWER)],
        input=json.dumps(sent), capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    read = np.array(json.loads(done.stdout)).reshape(-1, 3, 4)
    np.testing.assert_allclose(read * 32767, np.array(wanted), atol=0.01)
