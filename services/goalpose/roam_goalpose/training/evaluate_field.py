"""How good a field is on shapes it has not seen: occupancy IoU per category, plain and with 3 cm of tolerance.

python -m roam_goalpose.training.evaluate_field --objects DIR --json FILE
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from roam_goalpose.field import Field, Latent
from roam_goalpose.training.examples import is_held_out
from roam_goalpose.training.scans import CHANGES, CLOUD
from roam_goalpose.training.store import HELD_OUT_SEEDS, Store, mesh_examples, open_or_write, procedural_examples

BAND = 0.03
"""Half width [m] of the tolerance band."""
PROBES = 32
"""How many places within the band are asked before an inside point counts as missed."""


@dataclass(frozen=True)
class ShapeScore:
    """Scores of one object over uniform queries in its box padded by 15 cm."""

    name: str
    category: str
    iou: float
    """Intersection over union of predicted and true inside."""
    iou_3cm: float
    """The same with errors of up to 3 cm forgiven, in both directions."""
    iou_beyond_3cm: float
    """The same over points more than 3 cm from the surface alone; not a number for shapes that are nowhere so thick."""
    front_error: float
    """Mean error of the predicted place along the seat's front [m]."""


@torch.no_grad()
def score_store(
    field: Field, store: Store, *, clouds: str = "plain", queries: int = 4000, threshold: float = 0.0
) -> list[ShapeScore]:
    """Scores of every object of a store; deterministic. `clouds` is one of `CHANGES`, `threshold` a logit."""
    scores: list[ShapeScore] = []
    for row in range(len(store)):
        random = np.random.default_rng([4, row])
        order = random.permutation(len(store.surface[row]))
        surface, normals = store.surface[row, order].astype(np.float32), store.normals[row, order]
        points = torch.from_numpy(CHANGES[clouds](surface, normals, random))[None]
        where = torch.from_numpy(store.queries[row, :queries].astype(np.float32))[None]
        distance = torch.from_numpy(store.distance[row, :queries].astype(np.float32))
        latent = field.encode(points)
        answer = field.answer(latent, where)
        predicted = answer.logit[0] > threshold
        forgiven = predicted.clone()
        missed = torch.nonzero(~predicted & (distance < 0))[:, 0]
        forgiven[missed] = _found_nearby(field, latent, where[0, missed], threshold)
        ious = occupancy_ious(predicted, forgiven, distance)
        front = (answer.place[0, :, 2] - where[0, :, 2]).abs().mean()
        scores.append(ShapeScore(store.names[row], store.categories[row], *ious, float(front)))
    return scores


@torch.no_grad()
def choose_threshold(field: Field, store: Store, *, shapes: int = 60) -> float:
    """The logit over which space counts as inside: best mean IoU on the first `shapes` training shapes."""
    candidates = np.arange(-2.0, 1.01, 0.25)
    total = np.zeros(len(candidates))
    for row in np.linspace(0, len(store) - 1, min(shapes, len(store))).astype(int):
        cloud = torch.from_numpy(store.surface[row, :CLOUD].astype(np.float32))[None]
        where = torch.from_numpy(store.queries[row, :2000].astype(np.float32))[None]
        inside = torch.from_numpy(store.distance[row, :2000].astype(np.float32)) < 0
        logit = field.occupancy(field.encode(cloud), where)[0]
        total += [_ratio((logit > t) & inside, (logit > t) | inside) for t in candidates]
    return float(candidates[total.argmax()])


def _found_nearby(field: Field, latent: Latent, missed: Tensor, threshold: float) -> Tensor:
    """Whether the field is inside anywhere within the band around each of the points `[K, 3]`."""
    offsets = torch.randn(PROBES, 3, generator=torch.Generator().manual_seed(0))
    offsets = BAND * offsets / offsets.norm(dim=-1, keepdim=True) * torch.linspace(0.2, 1.0, PROBES)[:, None]
    probes = (missed[:, None] + offsets).flatten(0, 1)
    logits = field.occupancy(latent, probes[None])[0]
    return (logits.unflatten(0, (-1, PROBES)) > threshold).any(-1) if len(missed) else missed[:, 0] > 0


def occupancy_ious(predicted: Tensor, forgiven: Tensor, distance: Tensor) -> tuple[float, float, float]:
    """IoU of predictions `[Q]` against signed distances `[Q]` [m]: plain, 3 cm forgiven, beyond 3 cm only.

    `forgiven` is the prediction, or true where the field is inside somewhere within the band.
    """
    inside = distance < 0
    plain = _ratio(predicted & inside, predicted | inside)
    right = forgiven & inside
    tolerant = _ratio(right, inside | (predicted & (distance > BAND)))
    far = distance.abs() > BAND
    beyond = _ratio(predicted & inside & far, (predicted | inside) & far) if (inside & far).sum() >= 20 else math.nan
    return plain, tolerant, beyond


def _ratio(part: Tensor, whole: Tensor) -> float:
    return float(part.sum() / whole.sum()) if whole.any() else 1.0


def by_category(scores: Sequence[ShapeScore]) -> dict[str, dict[str, float]]:
    """Mean scores per category and over all shapes (`all`)."""
    groups: dict[str, list[ShapeScore]] = defaultdict(list)
    for score in scores:
        groups[score.category].append(score)
        groups["all"].append(score)
    return {category: _means(group) for category, group in sorted(groups.items())}


def _means(group: Sequence[ShapeScore]) -> dict[str, float]:
    means: dict[str, float] = {"objects": len(group)}
    for name in ("iou", "iou_3cm", "iou_beyond_3cm", "front_error"):
        values = [value for score in group if not math.isnan(value := getattr(score, name))]
        if values:
            means[name] = round(float(np.mean(values)), 4)
    return means


def print_table(name: str, table: dict[str, dict[str, float]]) -> None:
    """One line per category."""
    print(f"{name}: objects, IoU, IoU 3 cm, IoU beyond 3 cm, front error [m]")
    for category, row in table.items():
        cells = [row.get(key, math.nan) for key in ("iou", "iou_3cm", "iou_beyond_3cm", "front_error")]
        numbers = "".join(f"{cell:12.3f}" for cell in cells)
        print(f"  {category:12} {row['objects']:4d}{numbers}")


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(description="Occupancy of the descriptor field on unseen shapes.")
    parser.add_argument("--weights", type=Path, default=Path("weights/field.safetensors"))
    parser.add_argument("--objects", type=Path, nargs="*", default=[], metavar="DIR")
    parser.add_argument(
        "--held-out", type=Path, nargs="*", default=[], metavar="DIR", help="training folders: only what was left out"
    )
    parser.add_argument("--procedural", type=int, default=30, metavar="N", help="generated shapes, never trained on")
    parser.add_argument(
        "--clouds", nargs="+", choices=tuple(CHANGES), default=["plain"], metavar="CHANGE", help=", ".join(CHANGES)
    )
    parser.add_argument("--threshold", type=float, default=0.0, help="logit over which space counts as inside")
    parser.add_argument("--data", type=Path, metavar="DIR", help="keep prepared shapes here; default: nowhere")
    parser.add_argument("--json", type=Path, metavar="FILE")
    return parser.parse_args(argv)


def prepared(args: argparse.Namespace, data: Path) -> dict[str, Store]:
    """The shapes that the command line names, by the folder's name; kept in `data`."""
    stores: dict[str, Store] = {}
    for folder in args.objects:
        stores[folder.name] = _meshes(data / folder.name, sorted(folder.glob("*.glb")))
    for folder in args.held_out:
        files = sorted(path for path in folder.glob("*.glb") if is_held_out(path.name))
        stores[f"{folder.name}-held-out"] = _meshes(data / f"{folder.name}-held-out", files)
    if args.procedural:
        stores["procedural"] = open_or_write(
            data / f"procedural-held-out-{args.procedural}",
            args.procedural,
            lambda: procedural_examples(args.procedural, seed=HELD_OUT_SEEDS),
        )
    return stores


def _meshes(folder: Path, files: list[Path]) -> Store:
    return open_or_write(folder, len(files), lambda: mesh_examples(files))


def main(argv: Sequence[str] | None = None) -> int:
    """Scores a field on folders of meshes in canonical form (metres, +Y up, facing +Z) and on generated furniture."""
    args = parse(argv)
    field = Field.load(args.weights)
    report: dict[str, dict[str, dict[str, float]]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name, store in prepared(args, args.data or Path(scratch)).items():
            for clouds in args.clouds:
                table = by_category(score_store(field, store, clouds=clouds, threshold=args.threshold))
                told = name if clouds == "plain" else f"{name}, {clouds}"
                report[told] = table
                print_table(told, table)
    if args.json:
        args.json.write_text(json.dumps({"threshold": args.threshold, "shapes": report}, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
