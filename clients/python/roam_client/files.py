"""Saving arrays without any service: .npz for numpy, .json for everything else."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from roam_client.errors import FormatError


def save_arrays(path: Path, arrays: dict[str, Any], extra: dict[str, Any]) -> None:
    """Writes `arrays` as .npz, or `arrays` and `extra` as .json.

    In the .npz, `extra` is one JSON text named "metadata": no reader needs pickle. FormatError for other endings.
    """
    ending = path.suffix.lower()
    if ending == ".npz":
        np.savez_compressed(path, **arrays, metadata=np.array(json.dumps(extra)))
    elif ending == ".json":
        lists = {name: np.asarray(value).tolist() for name, value in arrays.items()}
        path.write_text(json.dumps({**lists, **extra}, allow_nan=False))
    else:
        raise FormatError(
            f"{path.name}: this client writes .npz and .json; for .glb and .bvh use the roam command, "
            "which has the services' exporters"
        )
