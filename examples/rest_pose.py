"""A goal pose over plain HTTP with nothing but Python itself: any language could do the same.

roam serve                                                    # in another shell
python examples/rest_pose.py http://127.0.0.1:8080 examples/objects/chair.glb
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen


def goal_pose(server: str, path: Path) -> dict[str, Any]:
    """Uploads a furniture file and asks for a pose on it. Raises HTTPError when the server refuses."""
    uploaded = post(f"{server}/v1/objects?format={path.suffix[1:]}", path.read_bytes(), "application/octet-stream")
    wanted = {"object": uploaded["name"], "action": "sit", "seed": 1}
    return post(f"{server}/v1/goal-poses", json.dumps(wanted).encode(), "application/json")


def post(address: str, body: bytes, media_type: str) -> dict[str, Any]:
    """One request; a refusal is a problem document (RFC 9457) that says what to do."""
    try:
        with urlopen(Request(address, body, {"Content-Type": media_type}), timeout=300) as response:
            return dict(json.load(response))
    except HTTPError as error:
        problem = json.load(error)
        print(problem["detail"], problem.get("remedy", ""), file=sys.stderr)
        raise


def main() -> None:
    """Prints the pose's quality and where its hips are."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server", help="HTTP address of the goal-pose service")
    parser.add_argument("object", type=Path, help="furniture file")
    arguments = parser.parse_args()
    pose = goal_pose(arguments.server, arguments.object)
    print(json.dumps(pose["diagnostics"], indent=1))
    x, y, z = pose["pose"]["root_position"]
    print(f"{pose['action']} from {pose['reference_pose']}: hips at {x:.2f}, {y:.2f}, {z:.2f} m")


if __name__ == "__main__":
    main()
