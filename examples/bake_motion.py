"""Baking for offline use: every file of a folder becomes one motion, as fast as it can be computed.

    roam serve                                                    # in another shell
    python examples/bake_motion.py 127.0.0.1:50051 examples/objects OUT

Writes OUT/NAME.npz (numpy arrays; see docs/how-to/quickstart.md for what is in them).
For .glb use `roam sit -o NAME.glb`.
"""

import argparse
from math import cos, sin
from pathlib import Path

from roam_client import Client, Motion, Placement, RoamError
from roam_client.types.objects import FORMATS


def bake(client: Client, path: Path) -> Motion:
    """One object: goal pose, then the walk from 3 m in front of it."""
    goal = client.synthesize(client.upload(path), seed=1)
    x, _, z = (float(value) for value in goal.root_position)
    yaw = goal.heading
    start = Placement(x + 3 * sin(yaw), z + 3 * cos(yaw), yaw + 3.1416)
    with client.create_session(start, floor_height=goal.floor_height, seed=1) as session:
        return session.bake(goal, hold=1.0)


def main() -> None:
    """Bakes a folder; a file that fails is named and does not stop the others."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server", help="gRPC address of both services")
    parser.add_argument("folder", type=Path, help="folder of furniture files")
    parser.add_argument("out", type=Path, help="folder to write to")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    files = [path for path in sorted(arguments.folder.iterdir()) if path.suffix.lower().removeprefix(".") in FORMATS]
    with Client(goalpose=arguments.server, motion=arguments.server, timeout=120) as client:
        for path in files:
            try:
                motion = bake(client, path)
            except RoamError as error:
                print(f"{path.name}: {error}")
                continue
            motion.save(arguments.out / f"{path.stem}.npz")
            nearest = float(motion.goal_distances().min()) * 100
            print(f"{path.name}: {motion.frame_count} frames, {nearest:.1f} cm from the goal pose")


if __name__ == "__main__":
    main()
