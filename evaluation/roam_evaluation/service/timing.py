"""What one build of the services takes, in the process of that build: frames of motion, and a goal pose.

Run by `roam_evaluation.service.compare` with the build's folders on the path, so it imports nothing of this package; a
build of before the packages were called roam_* has the same modules by other names.
"""

import json
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import torch

_FRAMES = 90
_REPEATS = 3  # goal poses


def _first(*names: str) -> Any:
    """The first of these modules that the build has."""
    for name in names:
        try:
            return import_module(name)
        except ModuleNotFoundError:
            continue
    raise SystemExit(f"this build has none of {', '.join(names)}")


def _goal(root: Path, object_file: Path) -> tuple[Any, Any, float]:
    """A pose and its shape, and the least seconds that a goal pose took."""
    synthesis = _first("roam_goalpose.synthesis", "goalpose.synthesis")
    loading = _first("roam_goalpose.objects", "goalpose.objects")
    settings = synthesis.SynthesizerSettings(
        weights=root / "weights" / "field.safetensors", references=root / "examples" / "references"
    )
    synthesizer = synthesis.Synthesizer.load(settings)
    shape = loading.load_shape(object_file.read_bytes(), "glb")
    seconds = []
    for seed in range(_REPEATS + 1):  # the first one warms up
        start = time.perf_counter()
        result = synthesizer.synthesize(shape, synthesis.GoalPoseRequest(action="sit", seed=seed))
        seconds.append(time.perf_counter() - start)
    return result.pose, shape, min(seconds[1:])


def _step_seconds(root: Path, pose: Any, shape: Any, characters: int) -> float:
    """Mean seconds of a frame of so many characters on their way to a goal."""
    animator_module = _first("roam_motion.animator", "motion.step")
    intent = _first("roam_motion.control.intent", "motion.intent")
    volume = _first("roam_goalpose.objects.volume", "goalpose.objects.volume").shape_volume(shape)
    animator = animator_module.Animator.load(root / "weights" / "motion.safetensors")
    goal = intent.Goal(pose, "sit", None, (), volume)
    states = [animator.start((0.0, 2.0 + 0.02 * seed), 3.14, seed) for seed in range(characters)]
    goals, start = [goal] * characters, 0.0
    for frame in range(_FRAMES + 5):
        if frame == 5:
            start = time.perf_counter()
        states = [state for state, *_ in animator.step(states, goals)]
    return (time.perf_counter() - start) / _FRAMES


def main() -> None:
    """Prints the figures as one line of JSON. Arguments: the build's root, a .glb file, numbers of characters."""
    root, object_file, counts = Path(sys.argv[1]), Path(sys.argv[2]), [int(n) for n in sys.argv[3:]]
    torch.set_num_threads(1)
    pose, shape, solve = _goal(root, object_file)
    figures = {"goal pose": solve}
    for count in counts:
        figures[f"frame of {count}"] = _step_seconds(root, pose, shape, count)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
