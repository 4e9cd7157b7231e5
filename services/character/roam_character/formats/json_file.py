"""JSON of poses and motions: the arrays of the NPZ as nested lists, names and marks beside them."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roam_character.formats.npz import scene_arrays
from roam_character.formats.registry import Format
from roam_character.formats.scene import Scene


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes one JSON object. Raises ValueError for numbers that JSON cannot hold."""
    lists = {name: np.asarray(value).tolist() for name, value in scene_arrays(scene).items()}
    path.write_text(json.dumps({**lists, **scene.extra}, allow_nan=False))
    return ()


FORMAT = Format("json", "JSON (the same arrays as lists)", (".json",), write=write)
