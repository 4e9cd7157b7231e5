"""A goal pose over plain HTTP: no client library, any language could do the same.

roam serve                                                    # in another shell
python examples/rest_pose.py http://127.0.0.1:8080 examples/objects/chair.glb
"""

import argparse
import json
from pathlib import Path
from typing import Any

import httpx


def goal_pose(server: str, path: Path) -> dict[str, Any]:
    """Uploads a furniture file and asks for a pose on it. Raises httpx.HTTPStatusError when the server refuses."""
    with httpx.Client(base_url=server, timeout=300) as http:
        query = {"format": path.suffix.removeprefix(".")}
        uploaded = http.post("/v1/objects", params=query, content=path.read_bytes())
        explain(uploaded)
        answer = http.post("/v1/goal-poses", json={"object": uploaded.json()["name"], "action": "sit", "seed": 1})
        explain(answer)
        return dict(answer.json())


def explain(response: httpx.Response) -> None:
    """Errors are problem documents (RFC 9457): say what is in them."""
    if response.is_error:
        problem = response.json()
        print(f"{problem['detail']} {problem.get('remedy', '')}")
    response.raise_for_status()


def main() -> None:
    """Prints the pose's quality and where its joints are."""
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
