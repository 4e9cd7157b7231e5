"""The driver of the Python client, sync or asyncio: plays one session and prints what comes as lines of JSON."""

import argparse
import asyncio
import json
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from google.protobuf.json_format import ParseDict
from roam.v1 import motion_pb2
from roam_client import AsyncClient, Client, Event, EventType, Frame, RoamError, ServerError


def as_json(item: Frame | Event) -> dict[str, Any]:
    """One line."""
    if isinstance(item, Event):
        return {
            "type": "event",
            "event": item.type.name,
            "sequence": item.sequence,
            "control_id": item.control_id,
            "skipped_count": item.skipped_count,
            "goal_pose": item.goal_pose,
        }
    return {
        "type": "frame",
        "sequence": item.sequence,
        "time": item.time,
        "root_position": item.root_position.tolist(),
        "rotations": item.rotations.ravel().tolist(),
        "contacts": item.contacts.tolist(),
        "action": item.action.name,
        "goal_distance": item.goal_distance,
    }


class Player:
    """Prints items and says which controls are due."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.done = False
        self._left = options.frames
        self._controls = [json.loads(text) for text in options.control]

    def due(self, sequence: int) -> Iterator[motion_pb2.ControlInput]:
        """The controls to send after this frame; 0: when the stream is open."""
        for control in [c for c in self._controls if c["after_sequence"] == sequence]:
            yield ParseDict({k: v for k, v in control.items() if k != "after_sequence"}, motion_pb2.ControlInput())

    def show(self, item: Frame | Event) -> None:
        """One item of the stream."""
        print(json.dumps(as_json(item)), flush=True)
        self._left -= isinstance(item, Frame)
        self.done = self._left == 0 or (isinstance(item, Event) and item.type is EventType.SESSION_ENDED)


def play(options: argparse.Namespace, wanted: dict[str, Any]) -> None:
    """With the client for ordinary code."""
    player = Player(options)
    with Client(motion=options.address) as client, client.session(options.session).stream(**wanted) as stream:
        for control in player.due(0):
            stream.send(control)
        for item in stream:
            player.show(item)
            for control in player.due(item.sequence) if isinstance(item, Frame) else ():
                stream.send(control)
            if player.done:
                break


async def play_async(options: argparse.Namespace, wanted: dict[str, Any]) -> None:
    """With the client for asyncio."""
    player = Player(options)
    async with AsyncClient(motion=options.address) as client:
        session = await client.session(options.session)
        async with session.stream(**wanted) as stream:
            for control in player.due(0):
                await stream.send(control)
            async for item in stream:
                player.show(item)
                for control in player.due(item.sequence) if isinstance(item, Frame) else ():
                    await stream.send(control)
                if player.done:
                    break


def main(words: Sequence[str] | None = None) -> int:
    """The program."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--address", required=True)
    parser.add_argument("--session", required=True)
    parser.add_argument("--pacing", default="realtime")
    parser.add_argument("--encoding", default="float32")
    parser.add_argument("--after-sequence", type=int, default=0)
    parser.add_argument("--frames", type=int, required=True)
    parser.add_argument("--control", action="append", default=[])
    parser.add_argument("--asyncio", action="store_true")
    options = parser.parse_args(words)
    wanted = {"pacing": options.pacing, "encoding": options.encoding, "after_sequence": options.after_sequence}
    try:
        if options.asyncio:
            asyncio.run(play_async(options, wanted))
        else:
            play(options, wanted)
    except RoamError as error:
        reason = error.reason if isinstance(error, ServerError) else type(error).__name__
        print(json.dumps({"type": "error", "reason": reason}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
