"""Writes the files of sessions/: messages of a real motion server, put into the situations that a client must master.

python clients/conformance/record.py
"""

import asyncio
import base64
from pathlib import Path
from typing import Any

import grpc.aio
import numpy as np
from roam.v1 import motion_pb2, motion_pb2_grpc, skeleton_pb2
from roam_client.connection.deltas import DeltaReader
from roam_motion.app import motion_server
from roam_motion.settings import MotionSettings
from script import FOLDER, ROOT, Script, Step, response

SESSION = "sessions/1f"
FRAMES, JOINTS = 14, 22
PAUSE: Step = {"pause": 0.7}  # [s]
Message = motion_pb2.AnimateResponse


async def recorded(encoding: int) -> list[Message]:
    """The header and the first frames of a character that sets out to walk."""
    async with (
        motion_server(MotionSettings(step_process=False)) as at,
        grpc.aio.insecure_channel(at.grpc) as channel,
    ):
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        start = motion_pb2.Placement(x=0.5, z=-1.0, yaw=0.75)
        session = (await stub.CreateSession(motion_pb2.CreateSessionRequest(start_placement=start, seed=1))).session
        steer = motion_pb2.ControlInput(control_id=1, steer=motion_pb2.Steer(velocity_x=0.3, velocity_z=1.0))
        await stub.Control(motion_pb2.ControlRequest(session=session.name, control=steer))
        opening = motion_pb2.Open(
            session=session.name, pacing=motion_pb2.PACING_BURST, rotation_encodings=[encoding], joint_positions=False
        )
        call = stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
        messages: list[Message] = []
        while len(messages) <= FRAMES:
            message = (await call.read()).message
            if message.WhichOneof("message") != "event":
                messages.append(message)
        call.cancel()
        return messages


def header(messages: list[Message], first: int = 1, *, bare: bool = False, controls: int = 0) -> Step:
    """The stream's header, as the first frame and the controls that the server has demand."""
    message = Message()
    message.CopyFrom(messages[0])
    message.header.session, message.header.first_sequence = SESSION, first
    message.header.resume_token, message.header.last_control_id = f"token-{first}", controls
    message.header.stream, message.header.exact = f"stream-{first}", first > 1
    if bare:
        message.header.skeleton.CopyFrom(skeleton_pb2.Skeleton(id=message.header.skeleton.id))
    return sending(message)


def sending(message: Message) -> Step:
    """A message as a step."""
    return {"send": base64.b64encode(message.SerializeToString(deterministic=True)).decode()}


def frames(messages: list[Message], first: int, last: int) -> list[Step]:
    """Frames first … last."""
    return [sending(messages[sequence]) for sequence in range(first, last + 1)]


def event(kind: str, sequence: int, **fields: Any) -> Step:
    """An event."""
    number = motion_pb2.EventType.Value(f"EVENT_TYPE_{kind}")
    return sending(Message(event=motion_pb2.SessionEvent(type=number, sequence=sequence, **fields)))


def line(step: Step, encoding: str = "float32", deltas: DeltaReader | None = None) -> dict[str, Any]:
    """What a driver prints of a message, read from its bytes as proto/README.md says; `deltas` read those before."""
    message = response(step)
    if message.HasField("event"):
        told = message.event
        return {
            "type": "event",
            "event": motion_pb2.EventType.Name(told.type).removeprefix("EVENT_TYPE_"),
            "sequence": told.sequence,
            "control_id": told.control_id,
            "skipped_count": told.skipped_count,
            "goal_pose": told.goal_pose,
        }
    frame = message.frame
    if encoding == "float32":
        rotations = np.frombuffer(frame.rotations, "<f4").astype(float)
    else:
        data = frame.rotations if deltas is None else deltas.read(frame.rotations)
        packed = np.frombuffer(data, "<i2").reshape(-1, 4) / 32767
        rotations = (packed / np.linalg.norm(packed, axis=1, keepdims=True)).ravel()
    return {
        "type": "frame",
        "sequence": frame.sequence,
        "time": frame.sequence / 30 if encoding == "delta16" else frame.time,
        "root_position": [round(float(v), 6) for v in np.frombuffer(frame.root, "<f4")[:3]],
        "rotations": [round(float(v), 6) for v in rotations],
        "action": skeleton_pb2.Action.Name(frame.action).removeprefix("ACTION_"),
    }


def script(name: str, about: str, connections: list[list[Step]], *, count: int, **client: Any) -> Script:
    """A session; the driver must print every frame once and every event."""
    encoding = client.get("encoding", "float32")
    sent = [step for steps in connections for step in steps if "send" in step or "send_file" in step]
    deltas = DeltaReader(JOINTS) if encoding == "delta16" else None
    told = [line(step, encoding, deltas) for step in sent if not response(step).HasField("header")]
    seen, output = 0, []
    for item in told:
        if item["type"] == "event" or item["sequence"] > seen:
            output.append(item)
            seen = max(seen, item["sequence"] if item["type"] == "frame" else 0)
    return Script(name, about, {"session": SESSION, "frames": count, **client}, connections, output)


def opened(after: int = 0, **fields: Any) -> Step:
    """The client opens the stream."""
    return {"expect_open": {"session": SESSION, "afterSequence": after, **fields}}


class Situations:
    """The sessions, made of the recorded messages."""

    def __init__(self, full: list[Message], short: list[Message], deltas: list[Message]) -> None:
        skeleton = full[0].header.skeleton.id
        self.full, self.short, self.deltas = full, short, deltas
        self.begun = [opened(), header(full), *frames(full, 1, 5)]
        self.resumed = [header(full, 6, bare=True), *frames(full, 6, 8)]
        self.again = opened(5, resumeToken="token-1", knownSkeletonId=skeleton)

    def all(self) -> list[Script]:
        """Every situation."""
        return [*self.decoding(), *self.breaks(), *self.events(), *self.controls(), refused()]

    def decoding(self) -> list[Script]:
        """Bytes and acknowledgements."""
        full, short = self.full, self.short
        names = ("stream_header", "event_goal_reached", "frame_snorm16")
        golden = [opened(), *({"send_file": f"proto/golden/{name}.bin"} for name in names)]
        packed = [opened(rotationEncodings=["ROTATION_ENCODING_SNORM16"]), header(short), *frames(short, 1, 5)]
        read = [opened(), header(full), {"wait_ack": 0}, *frames(full, 1, 8), {"wait_ack": 4}, *frames(full, 9, 9)]
        options: dict[str, Any] = {"encoding": "snorm16", "pacing": "burst"}
        return [
            script("decode", "frames with float32 rotations", [self.begun], count=5, pacing="burst"),
            script("decode-snorm16", "frames with packed rotations", [packed], count=5, **options),
            self.decoding_deltas(),
            script("golden", "the byte vectors of proto/golden", [golden], count=1, **options),
            script("acknowledge", "a reader in real time acknowledges", [read], count=9),
        ]

    def decoding_deltas(self) -> Script:
        """Rotations as differences from the frames before."""
        asked = {"rotationEncodings": ["ROTATION_ENCODING_DELTA16", "ROTATION_ENCODING_SNORM16"]}
        steps = [opened(**asked), header(self.deltas), *frames(self.deltas, 1, 9)]
        about = "frames told as differences from those before (for clients that read delta16)"
        return script("decode-delta16", about, [steps], count=9, encoding="delta16", pacing="burst")

    def breaks(self) -> list[Script]:
        """Streams that break or fall silent, and go on."""
        resumed = [self.again, *self.resumed]
        repeated = [self.again, header(self.full, 4, bare=True), *frames(self.full, 4, 8)]
        lost, cancelled = [PAUSE, {"end": "UNAVAILABLE"}], [PAUSE, {"end": "CANCELLED"}]
        held = [opened(), {"end": "UNAVAILABLE", "reason": "SESSION_ELSEWHERE"}]
        about = {
            "resume": ("a broken stream goes on after the last frame", [[*self.begun, *lost], resumed], 8),
            "resume-cancelled": ("the server of a stream shuts down", [[*self.begun, *cancelled], resumed], 8),
            "repeat": ("frames come once more after a resume", [[*self.begun, *lost], repeated], 8),
            "elsewhere": ("the session is with another replica for now", [held, self.begun], 5),
            "silence": ("a stream in real time falls silent", [[*self.begun, {"silence": 6}], resumed], 8),
        }
        return [script(name, words, connections, count=count) for name, (words, connections, count) in about.items()]

    def events(self) -> list[Script]:
        """What happens to a session."""
        full = self.full
        drained = [[*self.begun, event("DRAINING", 5), PAUSE, {"end": "OK"}], [self.again, *self.resumed]]
        skipped = event("FRAMES_SKIPPED", 7, skipped_count=3)
        skip = [opened(), header(full), *frames(full, 1, 3), skipped, *frames(full, 7, 8)]
        ended = [*self.begun, event("SESSION_ENDED", 5), PAUSE, {"end": "OK"}]
        return [
            script("drain", "a server that shuts down says so and ends the stream", drained, count=8),
            script("skip", "frames are skipped for a slow reader", [skip], count=5),
            script("ended", "the session ends, and with it the stream", [ended], count=99),
        ]

    def controls(self) -> list[Script]:
        """Controls that a break may have swallowed."""
        full, sent = self.full, {"wait_control": {"controlId": "1"}}
        steer = {"after_sequence": 2, "steer": {"velocityX": 0.5, "velocityZ": 1.0}}
        steps = [opened(), header(full), *frames(full, 1, 3), sent, *frames(full, 4, 5), PAUSE, {"end": "UNAVAILABLE"}]
        unknown = [self.again, header(full, 6, bare=True), sent, *frames(full, 6, 8)]
        bare = header(full, 6, bare=True, controls=1)
        known = [self.again, bare, *frames(full, 6, 8), {"wait_ack": 5}, {"no_control": True}, *frames(full, 9, 9)]
        again, once = "a control that the server never had is sent again", "a control that it has is not sent again"
        return [
            script("control-again", again, [steps, unknown], count=8, control=[steer]),
            script("control-once", once, [steps, known], count=9, control=[steer]),
        ]


def refused() -> Script:
    """A stream that the server does not open: no client tries that twice."""
    steps = [opened(), {"end": "NOT_FOUND", "reason": "SESSION_NOT_FOUND"}]
    client = {"session": SESSION, "frames": 1}
    said = [{"type": "error", "reason": "SESSION_NOT_FOUND"}]
    return Script("error", "the server says no: its reason is told, and nothing is tried again", client, [steps], said)


def main() -> None:
    """The program."""
    full = asyncio.run(recorded(motion_pb2.ROTATION_ENCODING_FLOAT32))
    short = asyncio.run(recorded(motion_pb2.ROTATION_ENCODING_SNORM16))
    deltas = asyncio.run(recorded(motion_pb2.ROTATION_ENCODING_DELTA16))
    for one in Situations(full, short, deltas).all():
        one.save(FOLDER)
    print(f"{len(list(FOLDER.glob('*.json')))} sessions in {Path(FOLDER).relative_to(ROOT)}")


if __name__ == "__main__":
    main()
