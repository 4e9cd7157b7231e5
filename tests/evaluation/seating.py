"""A box chair as an evaluation object, a person on it, and the record of that person's pose."""

from functools import cache
from pathlib import Path

import numpy as np
from roam_evaluation.goalpose.inputs.objects import EvaluationObject
from roam_evaluation.goalpose.runs import Run
from roam_goalpose.references.pairs import load_reference

ROOT = Path(__file__).parents[2]
CHAIR = EvaluationObject(ROOT / "examples" / "references" / "chair_sit.glb", "chair", "", 0.45)


@cache
def sitter():
    """The reference pair whose object `CHAIR` is."""
    return load_reference(CHAIR.path.with_suffix(".json"))


def run(**changes):
    """A good run on it, with changes."""
    pose = sitter().pose
    values = {
        "object": "chair",
        "category": "chair",
        "subtype": "",
        "variant": "plain",
        "initial_yaw": 0.0,
        "reference": "chair_sit",
        "hip_distance": 0.01,
        "lateral": 0.0,
        "heading_error": 0.02,
        "penetration": 0.02,
        "bone_depths": {"hips": 0.02},
        "floor": 0.01,
        "hang": 0.0,
        "seconds": 1.0,
        "cpu_seconds": 1.0,
        "turn_error": None,
        "warnings": [],
        "diagnostics": {},
        "energies": {"total": 0.5},
        "root_position": np.asarray(pose.root_position).tolist(),
        "rotations": np.asarray(pose.rotations).tolist(),
    }
    return Run(**(values | changes))
