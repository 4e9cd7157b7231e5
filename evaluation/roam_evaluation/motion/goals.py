"""Goal poses to walk up to: synthesised on a folder of objects (and remembered), floor at zero.

As a program it fills a folder with goal poses, for evaluations that share them and for `roam train motion --goals DIR`:

    python -m roam_evaluation.motion.goals --objects DIR --action sit --poses DIR
"""

import argparse
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from roam_character.pose import Pose
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.objects import ObjectError, Shape, format_of, load_shape
from roam_goalpose.objects.footprint import footprint
from roam_goalpose.objects.volume import shape_volume
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer, SynthesizerSettings
from roam_motion.control.intent import Goal

from roam_evaluation.goalpose.inputs.objects import EvaluationObject, find_objects


@dataclass(frozen=True, eq=False)
class SeatGoal:
    """One goal pose and the object under it, both with the floor at y = 0."""

    name: str
    category: str
    action: str
    pose: Pose
    shape: Shape

    @cached_property
    def intent(self) -> Goal:
        """What a character is told: the pose, and the object's outlines as obstacles."""
        outlines = tuple(tuple(map(tuple, corners.tolist())) for corners in footprint(self.shape.points))
        down = np.array([0.0, -self.shape.floor_height, 0.0])
        return Goal(self.pose, self.action, None, outlines, shape_volume(self.shape).moved(down))


def make_goals(
    objects: Iterable[EvaluationObject], *, action: str, remembered: Path | None, weights: Path | None = None
) -> list[SeatGoal]:
    """A goal pose for every readable object, from `remembered`/NAME-ACTION.json where it exists already."""
    synthesizer: Synthesizer | None = None
    goals = []
    for item in objects:
        try:
            shape = load_shape(item.path.read_bytes(), format_of(item.path.name))
        except ObjectError as error:
            print(f"{item.name}: {error}")
            continue
        note = remembered / f"{item.name}-{action}.json" if remembered else None
        if note is None or not note.exists():
            if synthesizer is None:
                synthesizer = Synthesizer.load(
                    SynthesizerSettings(weights=weights) if weights else SynthesizerSettings()
                )
            result = synthesizer.synthesize(shape, GoalPoseRequest(action=action))
            record = {
                "root_position": result.pose.root_position.tolist(),
                "rotations": result.pose.rotations.tolist(),
                "floor_height": shape.floor_height,
            }
            if note is not None:
                note.parent.mkdir(parents=True, exist_ok=True)
                note.write_text(json.dumps(record))
        else:
            record = json.loads(note.read_text())
        goals.append(_goal(item, action, record, shape))
    return goals


def _goal(item: EvaluationObject, action: str, record: dict[str, list[float]], shape: Shape) -> SeatGoal:
    pose = Pose(
        humanoid_skeleton(), np.array(record["root_position"], np.float32), np.array(record["rotations"], np.float32)
    )
    pose = pose.moved(np.array([0, -shape.floor_height, 0], np.float32))
    return SeatGoal(item.name, item.category, action, pose, shape)


def main(argv: Sequence[str] | None = None) -> int:
    """Makes the goal poses that are not there yet."""
    parser = argparse.ArgumentParser(description="goal poses on every object of a folder")
    parser.add_argument("--objects", type=Path, action="append", required=True, help="folder of meshes (repeatable)")
    parser.add_argument("--categories", help="comma-separated, default all but beds")
    parser.add_argument("--action", default="sit", choices=("sit", "lie"))
    parser.add_argument("--poses", type=Path, required=True, help="folder to fill")
    parser.add_argument("--every", type=int, default=1, help="only every so many-th object")
    options = parser.parse_args(argv)
    torch.set_num_threads(1)
    categories = set(options.categories.split(",")) if options.categories else None
    objects = find_objects(options.objects, held_out=(), categories=categories)[:: options.every]
    print(len(make_goals(objects, action=options.action, remembered=options.poses)), "goal poses")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
