"""Puts a checkpoint where the services find it: weights/motion.safetensors and its entry in weights/manifest.json.

What was trained on share-alike clips goes into a file of its own, weights/motion-cc-by-sa.safetensors.

python -m roam_motion.training.publish runs/mine/best.pt [--weights weights]
"""

import argparse
import hashlib
import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import torch

from roam_motion.animation.figure import humanoid_figure
from roam_motion.training.data.library import LibraryConfig, load_library
from roam_motion.training.data.licences import APACHE, SHARE_ALIKE
from roam_motion.training.learning.weights import export

FILES = {APACHE: "motion.safetensors", SHARE_ALIKE: "motion-cc-by-sa.safetensors"}  # by the weights' licence


def main(argv: Sequence[str] | None = None) -> int:
    """Exports and records a checkpoint. Returns the process exit code."""
    parser = argparse.ArgumentParser(description="publish a motion checkpoint")
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--weights", type=Path, default=Path("weights"))
    parser.add_argument("--cache", type=Path, default=Path("runs/cache"))
    parser.add_argument("--measured", type=Path, help="JSON of `roam evaluate motion` on these weights")
    options = parser.parse_args(argv)
    torch.set_num_threads(1)
    run = json.loads((options.checkpoint.parent / "config.json").read_text())
    known = {f.name for f in fields(LibraryConfig)}
    kept: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in run["library"].items() if k in known}
    library = LibraryConfig(**kept)
    figure = humanoid_figure()
    dataset, _, summary = load_library(figure, library, options.cache)
    state = torch.load(options.checkpoint, weights_only=True)
    licence = str(summary["licence"])
    name = FILES[licence]
    path = options.weights / name
    scores = export(options.checkpoint, path, figure, dataset)
    entry = {
        "file": name,
        "licence": licence,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "skeleton": figure.skeleton.id,
        "data": {"folders": [Path(f).name for f in library.folders], **_counted(summary)},
        "recipe": {k: v for k, v in run.items() if k not in ("library", "data")},
        "updates": state["updates"],
        "trained_minutes": round(state["seconds"] / 60, 1),
        "validation": scores,
    }
    if options.measured:
        entry["measured"] = json.loads(options.measured.read_text())
    manifest = options.weights / "manifest.json"
    # Read again just before writing: the field's training writes its own entry to the same file.
    whole = json.loads(manifest.read_text()) if manifest.exists() else {}
    whole[name] = entry
    manifest.write_text(json.dumps(whole, indent=2) + "\n")
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB, {entry['updates']} updates, {json.dumps(scores)}")
    return 0


def _counted(summary: dict[str, object]) -> dict[str, object]:
    """A data summary with the numbers of files that were rejected and held out instead of their names."""
    return {key: len(value) if isinstance(value, list) else value for key, value in summary.items()}


if __name__ == "__main__":
    raise SystemExit(main())
