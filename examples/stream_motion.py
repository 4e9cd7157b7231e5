"""A character streamed over gRPC in real time, as a game would drive its own: walk up, sit, stand up again.

roam serve                                                    # in another shell
python examples/stream_motion.py 127.0.0.1:50051 examples/objects/chair.glb
"""

import argparse
import asyncio
from pathlib import Path

from roam_client import Action, AsyncClient, AsyncSession, Event, EventType, Frame, GoalPose, Placement, controls


async def perform(server: str, path: Path, *, seconds: float = 60.0) -> list[Frame]:
    """Plays one visit to a piece of furniture; answers the frames that were shown."""
    async with AsyncClient(goalpose=server, motion=server, timeout=120) as client:
        goal = await client.synthesize(await client.upload(path), action=Action.SIT, seed=1)
        x, _, z = (float(value) for value in goal.root_position)
        start = Placement(x, z + 2.5, 3.14)
        async with await client.create_session(start, floor_height=goal.floor_height) as session:
            return await asyncio.wait_for(visit(session, goal), seconds)


async def visit(session: AsyncSession, goal: GoalPose) -> list[Frame]:
    """Sends the goal, then stands up once it is reached; ends when the character stands."""
    shown: list[Frame] = []
    reached = False
    async with session.stream(encoding="snorm16") as stream:
        await stream.send(controls.go_to(goal))
        async for item in stream:
            if isinstance(item, Event):
                print(f"frame {item.sequence}: {item.type.name.lower()} {item.message}")
                if item.type is EventType.GOAL_REACHED:
                    reached = True
                    await stream.send(controls.stand_up())
                continue
            shown.append(item)  # an engine would set its skeleton's bones here: item.root_position, item.rotations
            if item.sequence % 30 == 0:
                print(f"{item.time:5.1f} s  {item.action.name.lower()}")
            if reached and item.action is Action.IDLE:
                return shown
    return shown


def main() -> None:
    """Runs one visit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server", help="gRPC address of both services")
    parser.add_argument("object", type=Path, help="furniture file")
    arguments = parser.parse_args()
    frames = asyncio.run(perform(arguments.server, arguments.object))
    print(f"{len(frames)} frames")


if __name__ == "__main__":
    main()
