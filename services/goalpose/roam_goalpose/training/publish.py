"""From a run to `weights/`: the file that serves, its line in the manifest, its section in the model card.

python -m roam_goalpose.training.publish runs/field-joint
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from roam_goalpose.field import Field
from roam_goalpose.training.evaluate_field import by_category, choose_threshold, score_store
from roam_goalpose.training.field import TrainingConfig, prepare, read_config
from roam_goalpose.training.scans import CLOUD

NAME = "field.safetensors"
HEADING = "## Descriptor field"
CREDITS = """\
Real meshes: Sweet Home 3D furniture libraries (BlendSwap CC0 and CC BY 3.0, Scopia CC BY 3.0), Kenney Furniture Kit
(CC0), Quaternius and KayKit packs (CC0), IKEA-Manuals-at-Work (CC BY 4.0, Yunong Liu et al.), IKEA Furniture Assembly
Environment (MIT, CLVR lab USC), AWS RoboMaker worlds (MIT-0), pal_gazebo_worlds (Apache 2.0, PAL Robotics),
react-planner (MIT), Babylon.js MeshesLibrary (CC BY 4.0); meshes made with the Infinigen 1.15.5 seating generators.
No mesh is part of this repository."""


LIMITS = """\
Besides occupancy the decoder was asked for signed distance and for the place on the object (off the mirror plane, over
the seat, to the front), which the paper does not do: descriptors then tell front from back. Known limits: thin legs,
spindles and slats come out ragged (hence the low plain IoU of chairs, bar stools and loungers); loungers are the
weakest kind; on stools the front means nothing; beds without a head board may be seen upside down."""


def measure(field: Field, config: TrainingConfig) -> dict[str, Any]:
    """Quality on shapes never trained on; the occupancy threshold comes from training shapes."""
    sources, held_out = prepare(config)
    threshold = choose_threshold(field, sources[0].store)
    quality: dict[str, Any] = {"occupancy_logit_threshold": threshold}
    for name, store in held_out.items():
        quality[f"held_out_{name}"] = by_category(score_store(field, store, threshold=threshold))
    counts = {Path(folder).name: len(source.store) for folder, source in zip(config.objects, sources, strict=False)}
    return {"trained_on": {**counts, "procedural": config.procedural}, "quality": quality}


def manifest_entry(
    weights: Path, config: TrainingConfig, state: dict[str, Any], measured: dict[str, Any], notes: str
) -> dict[str, Any]:
    """What `weights/manifest.json` says about the file; `notes` are the run's own remarks."""
    recipe = {k: v for k, v in asdict(config).items() if k not in {"out", "data", "objects", "network"}}
    if config.init is not None:
        recipe["init"] = hashlib.sha256(Path(config.init).read_bytes()).hexdigest()
    return {
        "file": NAME,
        "sha256": hashlib.sha256(weights.read_bytes()).hexdigest(),
        "network": asdict(config.network),
        "data": measured["trained_on"],
        "recipe": recipe,
        "steps": state["step"],
        "minutes": round(state["seconds"] / 60, 1),
        "measured": measured["quality"],
        "notes": notes,
    }


def card_section(entry: dict[str, Any]) -> str:
    """The model card's section."""
    data, quality, recipe = entry["data"], entry["measured"], entry["recipe"]
    shapes = ", ".join(f"{count} {name}" for name, count in data.items())
    lines = [
        HEADING,
        "",
        f"`{NAME}`: vector-neuron encoder and occupancy decoder (paper 3.1.1), one model",
        f"for {len(recipe['categories'])} categories. Trained for {entry['minutes']} minutes on one CPU thread",
        f"({entry['steps']} steps of {recipe['batch']} objects, seed {recipe['seed']}{_begun(recipe)})",
        f"on {shapes} shapes. The `test` set was never used, and about a sixth of the real `train`",
        "meshes is held out by a hash of the file name.",
        "",
        f"Occupancy at logit > {quality['occupancy_logit_threshold']} (chosen on training shapes), from {CLOUD:,}",
        "surface points as the service takes, over uniform queries in the box padded by 15 cm. *3 cm*: errors of up to",
        "3 cm forgiven; *beyond*: only points more than 3 cm from the surface count (left out where a shape is nowhere",
        "so thick). Counted with the labels of today, in which bodies without an underside are solid.",
    ]
    for name in (key for key in quality if key.startswith("held_out_")):
        lines += ["", f"{name.removeprefix('held_out_').capitalize()} shapes, held out:", "", *_table(quality[name])]
    lines += ["", *LIMITS.splitlines(), *([""] if entry["notes"] else []), *entry["notes"].splitlines()]
    lines += ["", *CREDITS.splitlines(), ""]
    return "\n".join(lines)


def _begun(recipe: dict[str, Any]) -> str:
    return f", begun with the weights `{recipe['init'][:12]}…`" if recipe["init"] else ""


def _table(scores: dict[str, dict[str, float]]) -> list[str]:
    rows = [
        "| category | objects | IoU | IoU, 3 cm | IoU, beyond | front error [m] |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for category, row in scores.items():
        cells = [f"{row[k]:.3f}" if k in row else "–" for k in ("iou", "iou_3cm", "iou_beyond_3cm", "front_error")]
        rows.append(f"| {category} | {row['objects']} | " + " | ".join(cells) + " |")
    return rows


def replace_section(card: str, section: str) -> str:
    """The card with the field's section put in, or exchanged for the new one."""
    before, found, rest = card.partition(HEADING)
    if not found:
        return (card.rstrip() + "\n\n" if card.strip() else "# Model card\n\n") + section
    following = rest.find("\n## ")
    return before + section + ("" if following < 0 else "\n" + rest[following + 1 :])


def publish(run: Path, weights: Path) -> dict[str, Any]:
    """Copies the run's field to `weights`, measures it, and writes manifest and card. Returns the manifest entry.

    Weights that the run began with must still be where they were: not in `weights`, where they are written over.
    """
    weights.mkdir(exist_ok=True)
    shutil.copyfile(run / NAME, weights / NAME)
    config = read_config(run)
    state = torch.load(run / "checkpoint.pt", weights_only=True)
    notes = (run / "notes.md").read_text().strip() if (run / "notes.md").exists() else ""
    entry = manifest_entry(weights / NAME, config, state, measure(Field.load(weights / NAME), config), notes)
    manifest_path, card_path = weights / "manifest.json", weights / "MODEL_CARD.md"
    manifest = json.loads(manifest_path.read_text()) if manifest_path.exists() else {}
    manifest[NAME] = entry
    manifest_path.write_text(json.dumps(manifest, indent=2) + "\n")
    card = card_path.read_text() if card_path.exists() else ""
    card_path.write_text(replace_section(card, card_section(entry)))
    return entry


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `python -m roam_goalpose.training.publish`."""
    parser = argparse.ArgumentParser(description="Publish a trained descriptor field.")
    parser.add_argument("run", type=Path)
    parser.add_argument("--weights", type=Path, default=Path("weights"))
    args = parser.parse_args(argv)
    entry = publish(args.run, args.weights)
    print(json.dumps(entry["measured"], indent=2))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
