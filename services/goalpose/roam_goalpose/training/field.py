"""Training of the descriptor field: `roam train field`.

    1. examples   real meshes of the given folders and generated furniture, made once into runs/field-data
    2. network    goalpose.field, from scratch or from a checkpoint
    3. loop       occupancy (paper 3.1.1) + distance + place on the object; Adam, cosine, running mean of the weights
    4. records    config.json, curves.csv, checkpoint.pt, field.safetensors in runs/<name>

Besides occupancy two more things are asked of the same activations, because descriptors are made of them: the signed
distance, so that points off the surface differ too, and the place relative to mirror plane, seat and front, so that
front and back of a near-symmetric chair differ. Both labels come for free from the canonical frame of training
shapes; nothing of the kind is needed at run time.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import structlog
import torch
from torch import Tensor
from torch.nn import functional

from roam_goalpose.field import Field, FieldConfig
from roam_goalpose.furniture import CATEGORIES
from roam_goalpose.training.batches import Batch, Source, draw
from roam_goalpose.training.evaluate_field import by_category, score_store
from roam_goalpose.training.examples import is_held_out
from roam_goalpose.training.store import (
    HELD_OUT_SEEDS,
    Store,
    kind_examples,
    mesh_examples,
    open_or_write,
    procedural_examples,
)

log = structlog.get_logger()

EVALUATE_EVERY = 360.0
"""Seconds between evaluations on held-out shapes; each also writes a checkpoint."""
INIT_RATE = 5e-4
"""Highest learning rate where a run begins with published weights."""
DAYBEDS = 150
"""Generated seats of bare boards to train on where sofas are among the categories."""


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Everything that decides a run."""

    out: str
    minutes: float = 90.0
    steps: int | None = None
    """Ends the run after so many steps instead, whatever the minutes: runs that are compared."""
    seed: int = 0
    objects: tuple[str, ...] = ()
    """Folders of meshes in canonical form; the first is split into training and held-out by `is_held_out`."""
    categories: tuple[str, ...] = CATEGORIES
    procedural: int = 3000
    """Generated pieces to train on."""
    data: str = "runs/field-data"
    batch: int = 16
    queries: int = 384
    rate: float = 1e-3
    rate_end: float = 2e-5
    average: float = 0.999
    """Decay of the running mean of the weights, which is what gets published."""
    init: str | None = None
    """Published weights to begin with, whose sizes count then; the network begins at random without."""
    network: FieldConfig = field(default_factory=FieldConfig)


class Run:
    """One training run and its folder."""

    def __init__(self, config: TrainingConfig, *, resume: bool = False) -> None:
        self.config = config
        self.folder = Path(config.out)
        self.folder.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(config.seed)
        self.field = Field(config.network)
        if config.init is not None:
            self.field.load_state_dict(Field.load(config.init).state_dict())
        self.averaged = Field(config.network).requires_grad_(False)
        self.averaged.load_state_dict(self.field.state_dict())
        self.optimiser = torch.optim.AdamW(
            self.field.parameters(), lr=config.rate, betas=(0.9, 0.99), weight_decay=1e-4
        )
        self.step, self.seconds, self.stopping = 0, 0.0, False
        if resume:
            self._restore()
        text = json.dumps(asdict(config), indent=2)
        (self.folder / "config.json").write_text(text)

    # ---- state

    def _restore(self) -> None:
        state = torch.load(self.folder / "checkpoint.pt", weights_only=True)
        self.field.load_state_dict(state["field"])
        self.averaged.load_state_dict(state["averaged"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.step, self.seconds = state["step"], state["seconds"]
        log.info("resumed", step=self.step, minutes=round(self.seconds / 60, 1))

    def checkpoint(self, sources: Sequence[Source]) -> None:
        """Writes the state for `--resume`, and the averaged weights ready to serve."""
        state = {
            "field": self.field.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
        }
        torch.save(state, self.folder / "checkpoint.tmp")
        (self.folder / "checkpoint.tmp").replace(self.folder / "checkpoint.pt")
        calibrate(self.averaged, sources)
        self.averaged.save(self.folder / "field.tmp")
        (self.folder / "field.tmp").replace(self.folder / "field.safetensors")

    def record(self, row: dict[str, Any]) -> None:
        """Appends a line to curves.csv."""
        path = self.folder / "curves.csv"
        new = not path.exists()
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(row))
            if new:
                writer.writeheader()
            writer.writerow(row)

    def stop(self, number: int, frame: FrameType | None) -> None:
        """Signal handler: finish the step, write a checkpoint, leave."""
        self.stopping = True

    # ---- loop

    def train(self, sources: Sequence[Source], held_out: dict[str, Store]) -> None:
        """Runs until the minutes are up, the steps are done or a signal comes."""
        signal.signal(signal.SIGINT, self.stop)
        signal.signal(signal.SIGTERM, self.stop)
        random = np.random.default_rng([5, self.config.seed, self.step])
        losses: list[dict[str, float]] = []
        evaluated = self.seconds
        while self._done() < 1.0 and not self.stopping:
            begin = time.monotonic()
            losses.append(self.one_step(draw(sources, random, size=self.config.batch, queries=self.config.queries)))
            self.seconds += time.monotonic() - begin
            if self.step % 50 == 0:
                self._report(losses)
                losses = []
            if self.seconds - evaluated > EVALUATE_EVERY:
                evaluated = self.seconds
                self.checkpoint(sources)
                self.evaluate(held_out)
        self.checkpoint(sources)
        self.evaluate(held_out)

    def one_step(self, batch: Batch) -> dict[str, float]:
        """One optimiser step; returns the losses."""
        for group in self.optimiser.param_groups:
            group["lr"] = self._rate()
        losses = field_losses(self.field, batch)
        total = losses["occupancy"] + 0.3 * losses["distance"] + 1.0 * losses["place"]
        self.optimiser.zero_grad(set_to_none=True)
        total.backward()
        torch.nn.utils.clip_grad_norm_(self.field.parameters(), 1.0)
        self.optimiser.step()
        self.step += 1
        decay = min(self.config.average, self.step / (self.step + 20))
        with torch.no_grad():
            for mean, value in zip(self.averaged.parameters(), self.field.parameters(), strict=True):
                mean.lerp_(value, 1 - decay)
        return {name: float(value.detach()) for name, value in losses.items()}

    def _done(self) -> float:
        """The part of the run that is over."""
        if self.config.steps is not None:
            return min(1.0, self.step / self.config.steps)
        return min(1.0, self.seconds / (self.config.minutes * 60))

    def _rate(self) -> float:
        done = self._done()
        warm = min(1.0, (self.step + 1) / 100)
        low, high = self.config.rate_end, self.config.rate
        return warm * (low + (high - low) * 0.5 * (1 + float(np.cos(np.pi * done))))

    def _report(self, losses: list[dict[str, float]]) -> None:
        mean = {name: round(float(np.mean([row[name] for row in losses])), 4) for name in losses[0]}
        done = self._done()
        left = round(self.seconds / 60 * (1 - done) / done, 1)
        self.record({"step": self.step, "minutes": round(self.seconds / 60, 2), "rate": round(self._rate(), 6), **mean})
        log.info("training", step=self.step, minutes_left=left, per_step=round(self.seconds / self.step, 2), **mean)

    def evaluate(self, held_out: dict[str, Store]) -> None:
        """Scores the averaged weights and appends them to scores.jsonl."""
        for name, store in held_out.items():
            table = by_category(score_store(self.averaged, store))
            log.info("held out", store=name, step=self.step, **table["all"])
            with (self.folder / "scores.jsonl").open("a") as file:
                file.write(
                    json.dumps({"step": self.step, "minutes": self.seconds / 60, "shapes": name, **table}) + "\n"
                )


def field_losses(field: Field, batch: Batch) -> dict[str, Tensor]:
    """Mean losses of a batch: occupancy (cross-entropy), distance [10 cm] and place [m] (smooth L1)."""
    answer = field.answer(field.encoder(batch.points), batch.queries)
    place = functional.smooth_l1_loss(answer.place, batch.place, beta=0.05, reduction="none") * batch.place_known
    return {
        "occupancy": functional.binary_cross_entropy_with_logits(answer.logit, batch.inside),
        "distance": functional.smooth_l1_loss(answer.distance, batch.distance, beta=0.2),
        "place": place.mean(),
    }


@torch.no_grad()
def calibrate(field: Field, sources: Sequence[Source]) -> None:
    """Measures mean and deviation of every descriptor number over ordinary queries and stores them in the field."""
    batch = draw(sources, np.random.default_rng(6), size=64, queries=256)
    latent = field.encoder(batch.points)
    numbers = torch.cat(field.decoder.activations(latent, batch.queries), -1).flatten(0, 1)
    field.mean.copy_(numbers.mean(0))
    field.deviation.copy_(numbers.std(0).clamp_min(1e-3))


# ---- examples


def prepare(config: TrainingConfig) -> tuple[list[Source], dict[str, Store]]:
    """Training sources and held-out stores; what is missing on disk is made first, which takes about a second each."""
    data = Path(config.data)
    sources: list[Source] = []
    held_out: dict[str, Store] = {}
    for number, folder in enumerate(config.objects):
        path = Path(folder)
        files = sorted(f for f in path.glob("*.glb") if f.name.split("_")[0] in config.categories)
        kept = [f for f in files if number == 0 and is_held_out(f.name)]
        used = [f for f in files if f not in kept]
        if kept:
            held_out["real"] = _store(data, f"{path.name}-held-out", config, kept)
        sources.append(Source(_store(data, path.name, config, used), share=[0.4, 0.12][min(number, 1)], stretch=1.25))
    label = _label(config)
    made = open_or_write(
        data / f"procedural{label}-{config.procedural}",
        config.procedural,
        lambda: procedural_examples(config.procedural, seed=0, categories=config.categories),
    )
    sources.append(Source(made, share=0.48, stretch=1.12))
    if "sofa" in config.categories:
        boards = open_or_write(data / f"daybed-{DAYBEDS}", DAYBEDS, lambda: kind_examples("daybed", DAYBEDS))
        sources.append(Source(boards, share=0.06, stretch=1.12))
    held_out["procedural"] = open_or_write(
        data / f"procedural{label}-held-out",
        90,
        lambda: procedural_examples(90, seed=HELD_OUT_SEEDS, categories=config.categories),
    )
    return sources, held_out


def _label(config: TrainingConfig) -> str:
    return "" if config.categories == CATEGORIES else "-" + "-".join(config.categories)


def _store(data: Path, name: str, config: TrainingConfig, files: list[Path]) -> Store:
    return open_or_write(data / f"{name}{_label(config)}", len(files), lambda: mesh_examples(files))


# ---- command


def parse(argv: Sequence[str]) -> tuple[TrainingConfig, bool]:
    """The configuration a command line asks for, and whether it continues an earlier run."""
    parser = argparse.ArgumentParser(prog="roam train field", description="Train the descriptor field.")
    parser.add_argument("--objects", nargs="+", default=[], metavar="DIR", help="folders of meshes in canonical form")
    parser.add_argument("--procedural-only", action="store_true", help="train on generated furniture alone")
    parser.add_argument("--procedural", type=int, default=3000, metavar="N", help="how many pieces to generate")
    parser.add_argument(
        "--categories", nargs="+", default=list(CATEGORIES), choices=CATEGORIES, help="default: all, jointly"
    )
    parser.add_argument("--minutes", type=float, default=90.0)
    parser.add_argument("--steps", type=int, metavar="N", help="end after so many steps, not by the clock")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="runs/field", metavar="RUN", help="folder of the run")
    parser.add_argument("--data", default="runs/field-data", metavar="DIR", help="where prepared examples are kept")
    parser.add_argument("--init", metavar="WEIGHTS", help="begin with published weights (.safetensors)")
    parser.add_argument("--resume", metavar="RUN", help="continue this run")
    args = parser.parse_args(argv)
    if args.resume:
        return replace(read_config(Path(args.resume)), out=args.resume, minutes=args.minutes, steps=args.steps), True
    config = TrainingConfig(
        out=args.out,
        minutes=args.minutes,
        steps=args.steps,
        seed=args.seed,
        objects=() if args.procedural_only else tuple(args.objects),
        categories=tuple(args.categories),
        procedural=args.procedural,
        data=args.data,
    )
    return (begun_from(config, args.init) if args.init else config), False


def begun_from(config: TrainingConfig, weights: str) -> TrainingConfig:
    """The configuration for going on from published weights: their sizes, and smaller steps than from scratch."""
    return replace(config, init=weights, rate=INIT_RATE, network=Field.load(weights).config)


def read_config(folder: Path) -> TrainingConfig:
    """The configuration of an earlier run."""
    values = json.loads((folder / "config.json").read_text())
    values["network"] = FieldConfig(**values["network"])
    values["objects"], values["categories"] = tuple(values["objects"]), tuple(values["categories"])
    return TrainingConfig(**values)


def run(config: TrainingConfig, *, resume: bool = False) -> Path:
    """Trains and returns the run's folder, in which `field.safetensors` is ready to serve."""
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS", "1")))
    sources, held_out = prepare(config)
    log.info("examples", train=sum(len(s.store) for s in sources), **{k: len(v) for k, v in held_out.items()})
    Run(config, resume=resume).train(sources, held_out)
    return Path(config.out)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `roam train field` and `python -m roam_goalpose.training.field`."""
    config, resume = parse(argv if argv is not None else sys.argv[1:])
    folder = run(config, resume=resume)
    log.info("done", weights=str(folder / "field.safetensors"))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
