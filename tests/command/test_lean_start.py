"""What `roam pose` imports when it solves in its own process: every module more is waited for at each prompt."""

import json
import subprocess
import sys
from pathlib import Path

from roam_command.installation import bundled_object
from roam_goalpose.synthesis import Synthesizer

# What reads files runs in a child process; nothing answers HTTP; nobody walks.
ELSEWHERE = {
    "scipy",
    "trimesh",
    "networkx",
    "fastapi",
    "starlette",
    "uvicorn",
    "sympy",
    "redis",
    "roam_motion.animator",
}

POSE = """
import json, sys
from roam_command.main import app
app(["pose", sys.argv[1], "-o", sys.argv[2], "--json"], standalone_mode=False)
print(json.dumps(list(sys.modules)), file=sys.stderr)
"""


def test_a_pose_is_made_without_what_other_processes_need(tmp_path: Path) -> None:
    keep_the_models_of_references()
    arguments = [str(bundled_object("chair")), str(tmp_path / "pose.json")]
    done = subprocess.run(
        [sys.executable, "-c", POSE, *arguments], capture_output=True, text=True, timeout=300, check=True
    )
    assert json.loads(done.stdout)["action"] == "sit"
    assert ELSEWHERE & set(json.loads(done.stderr.splitlines()[-1])) == set()


def keep_the_models_of_references() -> None:
    """What any earlier command of this build has left for later ones."""
    synthesizer = Synthesizer.load()
    for pair in synthesizer.references.values():
        if pair.action == "sit":
            synthesizer.model(pair, 0, synthesizer.config.samples)
