"""`roam evaluate goalpose categories`: does one field for all kinds of furniture lose anything against specialists?

    roam evaluate goalpose categories --objects TRAIN GENERATED --test TEST --steps 1200 --json FILE

A field for chairs, one for sofas, one for beds, one for stools and benches, and one for all of these are trained from
scratch with the same number of updates, batches and seed, each on its categories of the same examples, and measured on
real meshes that none of them saw: the held-out ones of the first folder and the test set, in every category.
"""

import argparse
import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch
from roam_goalpose.field import Field
from roam_goalpose.training.batches import Source
from roam_goalpose.training.evaluate_field import ShapeScore, by_category, choose_threshold, score_store
from roam_goalpose.training.field import Run, TrainingConfig, prepare
from roam_goalpose.training.store import Store, mesh_examples, open_or_write

from roam_evaluation.goalpose.scores import share
from roam_evaluation.shared.ledger import Ledger, Record

SPECIALISTS: dict[str, tuple[str, ...]] = {
    "chairs": ("chair", "armchair", "officechair"),
    "sofas": ("sofa",),
    "beds": ("bed",),
    "stools": ("stool", "barstool", "bench"),
}
MODELS = {**SPECIALISTS, "joint": tuple(category for group in SPECIALISTS.values() for category in group)}
GOOD = 0.8  # IoU with 3 cm of tolerance


@dataclass(frozen=True)
class Shapes:
    """What models are trained on, and the stores that they are measured on, by name."""

    sources: list[Source]
    unseen: dict[str, Store]


def examples(config: TrainingConfig, test: Path) -> Shapes:
    """The examples of all categories; what is missing on disk is made first."""
    sources, held_out = prepare(config)
    files = sorted(test.glob("*.glb"))
    tested = open_or_write(Path(config.data) / test.name, len(files), lambda: mesh_examples(files))
    return Shapes(sources, {"held-out": held_out["real"], "test": tested})


def trained(config: TrainingConfig, model: str, shapes: Shapes) -> tuple[Field, float, Run]:
    """A model's field, the logit over which it means inside, and its run. Raises SystemExit when it is interrupted."""
    sources = [replace(source, store=source.store.only(MODELS[model])) for source in shapes.sources]
    sources = [source for source in sources if len(source.store)]
    run = Run(replace(config, out=f"{config.out}/{model}", categories=MODELS[model]))
    run.train(sources, {})
    if run.stopping:
        raise SystemExit(f"interrupted; the models before {model} are kept")
    field = Field.load(run.folder / "field.safetensors")
    return field, choose_threshold(field, sources[0].store), run


def evaluate_model(config: TrainingConfig, model: str, shapes: Shapes) -> list[Record]:
    """Trains one model and scores it on every object that it did not see, of its categories and of the others."""
    field, threshold, run = trained(config, model, shapes)
    about = {"model": model, "threshold": threshold, "minutes": round(run.seconds / 60, 1)}
    records: list[Record] = []
    for name, store in shapes.unseen.items():
        scores = score_store(field, store.only(MODELS["joint"]), threshold=threshold)
        records += [{**about, "shapes": name, **_record(score)} for score in scores]
        print(model, name, by_category(scores)["all"], file=sys.stderr, flush=True)
    return records


def _record(score: ShapeScore) -> Record:
    return {name: None if value != value else value for name, value in asdict(score).items()}


def _score(record: Record) -> ShapeScore:
    names = ShapeScore.__dataclass_fields__
    values: dict[str, Any] = {name: math.nan if record[name] is None else record[name] for name in names}
    return ShapeScore(**values)


def summarise(records: Iterable[Record]) -> dict[str, Any]:
    """IoU by model and group of categories, held-out and test meshes together."""
    found = list(records)
    models = dict.fromkeys(record["model"] for record in found)
    return {
        model: {
            group: _figures([r for r in found if r["model"] == model and r["category"] in categories])
            for group, categories in (MODELS | {"all": MODELS["joint"]}).items()
            if group != "joint"
        }
        for model in models
    }


def _figures(records: list[Record]) -> dict[str, float | None]:
    scores = [_score(record) for record in records]
    means = dict(by_category(scores).get("all", {}))
    return {**means, "good": share(score.iou_3cm >= GOOD for score in scores)}


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose categories", description=__doc__.split("\n")[0])
    parser.add_argument("--objects", nargs="+", required=True, metavar="DIR", help="training folders, as for training")
    parser.add_argument("--test", type=Path, required=True, metavar="DIR", help="folder that nothing is trained on")
    parser.add_argument("--models", nargs="+", choices=tuple(MODELS), default=tuple(MODELS), metavar="MODEL")
    parser.add_argument("--steps", type=int, default=1200, help="updates of every model")
    parser.add_argument("--procedural", type=int, default=1000, metavar="N", help="generated pieces to train on")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="runs/categories", metavar="DIR", help="folder of the runs")
    parser.add_argument("--data", default="runs/field-data", metavar="DIR", help="where prepared examples are kept")
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    torch.set_num_threads(1)
    config = TrainingConfig(
        out=options.out,
        steps=options.steps,
        seed=options.seed,
        objects=tuple(options.objects),
        procedural=options.procedural,
        data=options.data,
    )
    plan = {name: getattr(config, name) for name in ("steps", "seed", "procedural", "batch", "queries", "rate")}
    ledger = Ledger(options.json, plan, summarise=summarise)
    shapes = examples(config, options.test)
    for model in ledger.pending(options.models):
        ledger.add(model, evaluate_model(config, model, shapes))
    for model, groups in ledger.report()["summary"].items():
        figures = "  ".join(f"{group} {row.get('iou_3cm', math.nan):.3f}" for group, row in groups.items())
        print(f"{model:8} IoU at 3 cm: {figures}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
