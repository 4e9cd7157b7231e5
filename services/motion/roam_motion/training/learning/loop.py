"""The training loop: roll out, remember, learn; checkpoints, curves, time left, clean stop, resume."""

import copy
import json
import math
import signal
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType

import torch
from safetensors import safe_open
from torch import Tensor

from roam_motion.animation.figure import Figure
from roam_motion.animation.prediction import Predict
from roam_motion.models.lnsm.config import WHOLE, Parts, network_config
from roam_motion.models.lnsm.features import Inputs, output_widths
from roam_motion.models.lnsm.network import MotionNetwork, Normaliser
from roam_motion.models.lnsm.predict import predicting
from roam_motion.training.data.dataset import Dataset
from roam_motion.training.learning.mirror import Mirror, mirror_of
from roam_motion.training.learning.rollout import Rollout

# Blocks that carry the motion on (hips, feet) and single numbers among hundreds count more.
_BLOCK_WEIGHTS = {"contacts": 3.0, "phase": 1.0, "trajectory": 0.7, "inverse_trajectory": 0.5, "inverse_axes": 0.7}
_JOINT_WEIGHTS = {0: 6.0}
_FEET_WEIGHT = 3.0
_TRUNK = ("spine", "chest", "upperChest", "neck", "head")
_TRUNK_WEIGHT = 2.5  # a lean that is missed by a little in every frame is missed altogether
_AVERAGE_EVERY = 8  # updates between two steps of the weight average


@dataclass(frozen=True)
class TrainingConfig:
    """One run; written to its folder."""

    minutes: float
    updates: int | None = None  # the run's length, whatever time that takes; None: `minutes`
    seed: int = 0
    batch: int = 256  # examples per update
    rollouts: int = 192  # characters rolled out side by side
    memory: int = 40_960  # remembered examples
    updates_per_step: int = 1
    rate: float = 8e-4
    last_rate: float = 4e-5
    decay: float = 1e-4
    warm_up: float = 0.08  # share of the time with single steps from the data
    horizon: float = 60.0  # frames; mean length of a roll-out in the end
    ramp: float = 0.35  # share of the time after which it is reached
    average: float = 0.999  # of weights, for validation and publication
    experts: int = 6
    encoding: int = 192
    hidden: int = 256


class Memory:
    """A ring of the latest examples."""

    def __init__(self, size: int) -> None:
        self.size, self.count, self.next = size, 0, 0
        self.columns: list[Tensor] = []

    def add(self, *columns: Tensor) -> None:
        """Appends examples, overwriting the oldest."""
        if not self.columns:
            self.columns = [torch.empty((self.size, *c.shape[1:])) for c in columns]
        rows = (self.next + torch.arange(len(columns[0]))) % self.size
        for own, new in zip(self.columns, columns, strict=True):
            own[rows] = new
        self.next = int((rows[-1] + 1) % self.size)
        self.count = min(self.count + len(rows), self.size)

    def draw(self, count: int, generator: torch.Generator) -> list[Tensor]:
        """A random batch."""
        rows = torch.randint(self.count, (count,), generator=generator)
        return [column[rows] for column in self.columns]


@dataclass
class Learner:
    """Network, optimiser and progress of a run."""

    network: MotionNetwork
    averaged: MotionNetwork
    normaliser: Normaliser
    optimiser: torch.optim.Optimizer
    joints: int
    seconds: float = 0.0
    updates: int = 0

    @property
    def parts(self) -> Parts:
        """What the network has of the method."""
        return self.network.config.parts

    def state(self) -> dict[str, object]:
        """Everything a resumed run needs."""
        return {
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "normaliser": self.normaliser.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "seconds": self.seconds,
            "updates": self.updates,
        }

    def load(self, state: dict[str, object]) -> None:
        """Continues from `state`."""
        for name in ("network", "averaged", "normaliser", "optimiser"):
            getattr(self, name).load_state_dict(state[name])
        self.seconds, self.updates = float(state["seconds"]), int(state["updates"])  # type: ignore[arg-type, call-overload]

    def begin_from(self, weights: Path) -> None:
        """Takes network and normaliser from published weights. ValueError when their sizes are others."""
        with safe_open(str(weights), "pt") as file:
            metadata = file.metadata()
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
        if json.loads(metadata["config"]) != self.network.config.as_dict():
            raise ValueError(f"{weights} has other sizes than this run: {metadata['config']}")
        for name, module in (("network", self.network), ("network", self.averaged), ("normaliser", self.normaliser)):
            own = {k.removeprefix(f"{name}."): v for k, v in tensors.items() if k.startswith(f"{name}.")}
            module.load_state_dict(own)
        self.updates = int(metadata["updates"])

    def predict(self, *, averaged: bool = False) -> Predict:
        """The motion model of the current (or averaged) weights."""
        return predicting(self.joints, self.parts, self.raw(averaged=averaged))

    def raw(self, *, averaged: bool = False) -> Callable[[Inputs], Tensor]:
        """Raw inputs -> raw outputs with the current (or averaged) weights."""
        network, normaliser = self.averaged if averaged else self.network, self.normaliser

        def call(inputs: Inputs) -> Tensor:
            columns = [normaliser.apply_to(n, getattr(inputs, n)) for n in ("frame", "goal", "gating")]
            return normaliser.undo("output", network(*columns))

        return call


def make_learner(figure: Figure, config: TrainingConfig, parts: Parts = WHOLE) -> Learner:
    """A fresh network and optimiser."""
    torch.manual_seed(config.seed)
    sizes = {"experts": config.experts, "encoding": config.encoding, "hidden": config.hidden}
    shape = network_config(figure.joint_count, parts=parts, **sizes)
    network = MotionNetwork(shape)
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=config.rate, weight_decay=config.decay, betas=(0.9, 0.99), fused=True
    )
    return Learner(network, copy.deepcopy(network), Normaliser(shape), optimiser, figure.joint_count)


@torch.no_grad()
def fit_normaliser(learner: Learner, rollout: Rollout, rounds: int = 24) -> None:
    """Column statistics from true states all over the data."""
    columns: dict[str, list[Tensor]] = {"frame": [], "goal": [], "gating": [], "output": []}
    actives = []
    for _ in range(rounds):
        rollout._restart(rollout.characters, torch.ones(len(rollout.at), dtype=torch.bool))
        inputs, output, active = rollout.example()
        inputs = rollout.parts.seen(inputs)
        for name in ("frame", "goal", "gating"):
            columns[name].append(getattr(inputs, name))
        columns["output"].append(output)
        actives.append(active)
    joined = {name: torch.cat(parts) for name, parts in columns.items()}
    active = torch.cat(actives) > 0.5
    inverse = _inverse_columns(rollout.figure)
    for name, values in joined.items():
        mean, std = values.mean(0), values.std(0)
        if name == "output" and int(active.sum()) > 1:
            mean[inverse], std[inverse] = values[active][:, inverse].mean(0), values[active][:, inverse].std(0)
        std = torch.where(std < 1e-4, torch.ones_like(std), std.clamp_min(2e-4))
        learner.normaliser.get_buffer(f"{name}_mean").copy_(mean)
        learner.normaliser.get_buffer(f"{name}_std").copy_(std)


def _inverse_columns(figure: Figure) -> slice:
    sizes = output_widths(figure.joint_count)
    start = sizes["positions"] + sizes["axes"]
    return slice(start, start + sizes["inverse_positions"] + sizes["inverse_axes"])


def column_weights(figure: Figure, without: Parts = WHOLE) -> Tensor:
    """Loss weight of every output column, mean one; nought `without` the part that it belongs to."""
    parts = []
    trunk = figure.skeleton.indices(_TRUNK)
    for name, width in output_widths(figure.joint_count).items():
        weight = torch.full((width,), _BLOCK_WEIGHTS.get(name, 1.0))
        if name.endswith(("positions", "axes")):
            weight.view(figure.joint_count, -1)[trunk] *= _TRUNK_WEIGHT
        if name in ("positions", "axes"):
            joints = weight.view(figure.joint_count, -1)
            for joint, value in _JOINT_WEIGHTS.items():
                joints[joint] = value
            if name == "positions":
                joints[figure.contacts] = _FEET_WEIGHT
        parts.append(weight)
    weights = torch.cat(parts)
    return weights / weights.mean() * ~without.missing(figure.joint_count)


def learn(
    learner: Learner,
    memory: Memory,
    config: TrainingConfig,
    weights: Tensor,
    figure: Figure,
    mirror: Mirror,
    generator: torch.Generator,
) -> float:
    """One update on examples and their mirror images; returns the loss."""
    frame, goal, gating, output, active = memory.draw((config.batch + 1) // 2, generator)
    mirrored = mirror.inputs(Inputs(frame, goal, gating))
    both = (torch.cat(pair) for pair in zip((frame, goal, gating), vars(mirrored).values(), strict=True))
    seen, output, active = (
        learner.parts.seen(Inputs(*both)),
        torch.cat([output, mirror.output(output)]),
        active.repeat(2),
    )
    norm = learner.normaliser
    inputs = [norm.apply_to(n, getattr(seen, n)) for n in ("frame", "goal", "gating")]
    error = learner.network(*inputs) - (output - norm.get_buffer("output_mean")) / norm.get_buffer("output_std")
    mask = torch.ones_like(output)
    mask[:, _inverse_columns(figure)] = active[:, None]
    # Huber beyond one deviation: the rare large corrections of roll-outs must not drown the everyday frame.
    huber = torch.where(error.abs() < 1, 0.5 * error.square(), error.abs() - 0.5)
    loss = (huber * weights * mask).mean()
    learner.optimiser.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(learner.network.parameters(), 1.0)
    learner.optimiser.step()
    learner.updates += 1
    if learner.updates % _AVERAGE_EVERY == 0:
        share = min(config.average, (1 + learner.updates) / (10 + learner.updates)) ** _AVERAGE_EVERY
        with torch.no_grad():
            torch._foreach_lerp_(list(learner.averaged.parameters()), list(learner.network.parameters()), 1 - share)
    return float(loss.detach())


def progress_of(learner: Learner, config: TrainingConfig) -> float:
    """The share of the run that is over."""
    if config.updates is not None:
        return learner.updates / config.updates
    return learner.seconds / (60 * config.minutes)


def horizon_at(progress: float, config: TrainingConfig) -> float:
    """Mean roll-out length [frames] at a share of the time: single steps, then a geometric rise."""
    share = (progress - config.warm_up) / max(config.ramp - config.warm_up, 1e-6)
    return float(config.horizon ** min(max(share, 0.0), 1.0))


def rate_at(progress: float, config: TrainingConfig) -> float:
    """Cosine from `rate` to `last_rate`, after a short linear start."""
    cosine = 0.5 * (1 + math.cos(math.pi * min(progress, 1.0)))
    return (config.last_rate + (config.rate - config.last_rate) * cosine) * min(1.0, progress / 0.005 + 0.05)


class Stop:
    """Turns SIGINT and SIGTERM into a flag, so that a run ends with a checkpoint."""

    def __init__(self) -> None:
        self.wanted = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._set)

    def _set(self, number: int, frame: FrameType | None) -> None:
        self.wanted = True


def train(
    figure: Figure,
    dataset: Dataset,
    config: TrainingConfig,
    run: Path,
    *,
    learner: Learner,
    validate: Callable[[Learner], dict[str, float]],
    report: Callable[[str], None] = print,
    every: float = 240.0,
) -> None:
    """Trains until `config.minutes` have passed or a signal comes; checkpoint and curves every `every` seconds."""
    generator = torch.Generator().manual_seed(config.seed + learner.updates)
    rollout = Rollout(figure, dataset, config.rollouts, generator, learner.parts)
    if learner.updates == 0:
        fit_normaliser(learner, rollout)
    memory, weights, stop = Memory(config.memory), column_weights(figure, learner.parts), Stop()
    mirror = mirror_of(figure)
    begin, before, saved = time.monotonic(), learner.seconds, time.monotonic()
    losses: list[float] = []
    aways: list[float] = []
    while not stop.wanted and (progress := progress_of(learner, config)) < 1:
        for group in learner.optimiser.param_groups:
            group["lr"] = rate_at(progress, config)
        with torch.no_grad():
            inputs, output, active = rollout.example()
        memory.add(inputs.frame, inputs.goal, inputs.gating, output, active)
        for _ in range(config.updates_per_step):
            losses.append(learn(learner, memory, config, weights, figure, mirror, generator))
        aways.append(rollout.step(learner.predict(), horizon_at(progress, config)))
        learner.seconds = before + time.monotonic() - begin
        if learner.updates % 200 == 0:
            _write_curve(run, learner, losses[-200:], aways[-200:], horizon_at(progress, config))
            report(_progress(learner, config, losses[-200:], aways[-200:]))
        if time.monotonic() - saved > every:
            checkpoint(run, learner, validate(learner))
            saved = time.monotonic()
    checkpoint(run, learner, validate(learner))


def _progress(learner: Learner, config: TrainingConfig, losses: list[float], aways: list[float]) -> str:
    left = (1 / max(progress_of(learner, config), 1e-6) - 1) * learner.seconds / 60
    loss, away = sum(losses) / len(losses), 100 * sum(aways) / len(aways)
    return f"update {learner.updates}  loss {loss:.4f}  off the track {away:.1f} cm  {left:.1f} min left"


def _write_curve(run: Path, learner: Learner, losses: list[float], aways: list[float], horizon: float) -> None:
    row = {
        "updates": learner.updates,
        "seconds": round(learner.seconds, 1),
        "loss": sum(losses) / len(losses),
        "away": sum(aways) / len(aways),
        "horizon": horizon,
    }
    with (run / "curve.jsonl").open("a") as file:
        file.write(json.dumps(row) + "\n")


def checkpoint(run: Path, learner: Learner, scores: dict[str, float]) -> None:
    """Writes latest.pt, and best.pt when the validation score is the lowest so far."""
    state = {**learner.state(), "scores": scores}
    torch.save(state, run / "latest.tmp")
    (run / "latest.tmp").replace(run / "latest.pt")
    with (run / "validation.jsonl").open("a") as file:
        file.write(json.dumps({"updates": learner.updates, "seconds": learner.seconds, **scores}) + "\n")
    best = run / "best.json"
    if not best.exists() or scores["score"] < json.loads(best.read_text())["score"]:
        torch.save(state, run / "best.tmp")
        (run / "best.tmp").replace(run / "best.pt")
        (run / "best.json.tmp").write_text(json.dumps({"updates": learner.updates, **scores}))
        (run / "best.json.tmp").replace(best)  # last: whoever reads the score finds the weights that reached it


def config_json(config: TrainingConfig, extra: dict[str, object]) -> str:
    """The run's configuration as JSON."""
    return json.dumps({**asdict(config), **extra}, indent=1)
