"""The files of clients/conformance/sessions: what a server says, what a client must say, and what it must print.

A step of a connection is one of

    {"expect_open": {…}}       the client opens the stream; the fields given must be so (proto JSON names)
    {"send": "base64"}         one AnimateResponse
    {"send_file": "path"}      the same from a file, relative to the repository
    {"wait_ack": 5}            until the client has acknowledged at least this sequence
    {"wait_control": {…}}      until a control with these fields has come
    {"no_control": true}       none has come on this connection
    {"pause": 0.7}             wait, so that the client has read everything before the call ends
    {"silence": 10}            say nothing for at most so many seconds: the client must come back by itself
    {"end": "UNAVAILABLE", "reason": "SESSION_ELSEWHERE"}   the call ends; OK is a polite end, the reason is optional
"""

import base64
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from google.protobuf.json_format import MessageToDict
from google.protobuf.message import Message
from roam.v1 import motion_pb2

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(__file__).parent / "sessions"
TOLERANCE = 1e-4  # of numbers that a client prints; snorm16 is good to 4e-5

Step = dict[str, Any]


@dataclass(frozen=True)
class Script:
    """One recorded session."""

    name: str
    about: str
    client: dict[str, Any]  # the arguments of the driver
    connections: list[list[Step]]
    output: list[dict[str, Any]]  # the lines that the driver must print

    @classmethod
    def load(cls, path: Path) -> "Script":
        """Reads a file."""
        return cls(**json.loads(path.read_text()))

    def save(self, folder: Path) -> None:
        """Writes the file."""
        text = json.dumps(vars(self), indent=1, ensure_ascii=False)
        (folder / f"{self.name}.json").write_text(text + "\n")


def scripts() -> list[Script]:
    """All of them, by name."""
    return [Script.load(path) for path in sorted(FOLDER.glob("*.json"))]


def response(step: Step) -> motion_pb2.AnimateResponse:
    """The message of a `send` or `send_file`."""
    data = base64.b64decode(step["send"]) if "send" in step else (ROOT / step["send_file"]).read_bytes()
    return motion_pb2.AnimateResponse.FromString(data)


def differences(message: Message, wanted: dict[str, Any]) -> list[str]:
    """Fields of a message that are not as wanted, in words; a default value may be wanted by its own name."""
    got = MessageToDict(message, always_print_fields_with_no_presence=True)
    return [f"{name} is {got.get(name)!r}, not {value!r}" for name, value in wanted.items() if got.get(name) != value]


def unlike(printed: list[dict[str, Any]], wanted: list[dict[str, Any]]) -> list[str]:
    """What is wrong with the lines that a driver printed."""
    wrong = [f"printed {len(printed)} lines, not {len(wanted)}"] if len(printed) != len(wanted) else []
    for number, (one, other) in enumerate(zip(printed, wanted, strict=False), start=1):
        for name, value in other.items():
            if name not in one:
                wrong.append(f"line {number}: {name} is missing")
            elif not _alike(one[name], value):
                wrong.append(f"line {number}: {name} is {one[name]!r}, not {value!r}")
    return wrong


def _alike(one: Any, other: Any) -> bool:
    if isinstance(other, list):
        return isinstance(one, list) and len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(other, float):
        return isinstance(one, int | float) and abs(one - other) <= TOLERANCE
    return bool(one == other)
