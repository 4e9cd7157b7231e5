"""Frames of many motions in one .npz file: what one build did, to be measured again by another."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from roam_evaluation.motion.people.frames import Motion, Stretch


def write_motions(path: Path, motions: list[Motion]) -> None:
    """Positions as float32, names and labels as JSON."""
    heads = [
        {"name": m.name, "person": m.person, "told": m.told, "stretches": [asdict(s) for s in m.stretches]}
        for m in motions
    ]
    arrays: dict[str, Any] = {f"positions_{n}": m.positions.astype(np.float32) for n, m in enumerate(motions)}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez_compressed(file, heads=np.array(json.dumps(heads)), **arrays)


def read_motions(path: Path) -> list[Motion]:
    """What `write_motions` wrote."""
    with np.load(path) as file:
        heads = json.loads(str(file["heads"]))
        return [
            Motion(
                head["name"],
                head["person"],
                file[f"positions_{number}"].astype(np.float64),
                tuple(Stretch(**s) for s in head["stretches"]),
                head["told"],
            )
            for number, head in enumerate(heads)
        ]
