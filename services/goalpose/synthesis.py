"""The application object: an object and a request in, a goal pose with energies, diagnostics and warnings out."""

import dataclasses
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from threading import Lock

import torch
from character.pose import Pose

from goalpose.candidates import Candidates, facing_yaw
from goalpose.diagnostics import PoseWarning, diagnose, warn
from goalpose.energy.descriptor import DescriptorField
from goalpose.energy.total import ReferenceModel, Target, models_stack
from goalpose.field.field import Field
from goalpose.objects import Shape
from goalpose.paper_solver import PaperConfig, solve_paper
from goalpose.places import find_places
from goalpose.progress import Listener, Progress, Watch
from goalpose.reference_model import model_reference
from goalpose.references import ACTIONS, ReferencePair, load_references
from goalpose.solver import SolverConfig, solve

SOLVERS = ("default", "paper")
ENCODER_POINTS = 1500
_CHECKOUT = Path(__file__).parents[2]


class RequestError(ValueError):
    """A request that cannot be served; names the field at fault."""

    def __init__(self, field_name: str, message: str) -> None:
        super().__init__(message)
        self.field = field_name


@dataclass(frozen=True, kw_only=True)
class SynthesizerSettings:
    """Where the weights and reference pairs are."""

    weights: Path = _CHECKOUT / "weights" / "field.safetensors"
    references: Path = _CHECKOUT / "examples" / "references"


@dataclass(frozen=True, kw_only=True)
class GoalPoseRequest:
    """What to adapt and how. Give `reference` (an id) or leave it to the fit by `action`."""

    reference: str | None = None
    action: str = "sit"
    initial_yaw: float | None = None  # [rad] first initial heading; None: the reference's own
    restarts: int = 0  # placements that are optimised (paper: initial headings); 0: the default
    seed: int = 0
    solver: str = "default"
    count: int = 1  # poses wanted: the best, then others that differ from it in place, heading or posture


@dataclass(frozen=True)
class CandidateSummary:
    """One of the placements that were optimised to the end."""

    energy: float
    root_position: tuple[float, float, float]
    heading: float  # [rad]


@dataclass(frozen=True, eq=False)
class RankedPose:
    """One of several poses on an object, in the object's world."""

    pose: Pose
    place: tuple[float, float, float]  # where the hips are over the object's surface, on that surface [m]
    reference: str
    action: str
    energies: dict[str, float]  # weighted terms and "total"
    diagnostics: dict[str, float]
    bone_depths: dict[str, float]  # deepest capsule of every bone in the object [m]; only bones that are in it
    warnings: tuple[PoseWarning, ...]


@dataclass(frozen=True, eq=False)
class GoalPoseResult:
    """The best pose, in the object's world."""

    name: str  # "goalPoses/sha256:…" of request, object and model
    pose: Pose
    energies: dict[str, float]  # weighted terms and "total"
    diagnostics: dict[str, float]
    warnings: tuple[PoseWarning, ...]
    reference: str
    action: str
    floor_height: float
    object: str
    seconds: float
    candidates: tuple[CandidateSummary, ...]
    poses: tuple[RankedPose, ...] = ()  # best first, beginning with `pose`; as many as there are, at most `count`


@dataclass(eq=False)
class Synthesizer:
    """Field, reference pairs and what was computed of them; safe to share between threads."""

    field: DescriptorField
    references: dict[str, ReferencePair]
    field_name: str = "field"
    config: SolverConfig = dataclasses.field(default_factory=SolverConfig)
    paper: PaperConfig = dataclasses.field(default_factory=PaperConfig)
    _models: dict[tuple[str, int, int], ReferenceModel] = dataclasses.field(default_factory=dict)
    _lock: Lock = dataclasses.field(default_factory=Lock)

    @classmethod
    def load(cls, settings: SynthesizerSettings | None = None) -> "Synthesizer":
        """Reads weights and references. Raises FileNotFoundError saying which file is missing."""
        settings = settings or SynthesizerSettings()
        if not settings.weights.exists():
            raise FileNotFoundError(f"no field weights at {settings.weights}; train them with `roam train field`")
        digest = hashlib.sha256(settings.weights.read_bytes()).hexdigest()
        return cls(Field.load(settings.weights), load_references(settings.references), f"sha256:{digest}")

    def synthesize(
        self,
        shape: Shape,
        request: GoalPoseRequest,
        *,
        progress: Listener | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> GoalPoseResult:
        """The best pose on `shape`. Same shape, request and weights give the same bytes.

        Raises RequestError for unknown references, actions or solvers, and Cancelled when `cancelled` says so.
        """
        started = time.perf_counter()
        pairs = self._chosen(request)
        watch = Watch(progress, cancelled)
        watch.tell(lambda: Progress(0, 0, self.config.iterations, 0.0, None))
        with torch.no_grad():
            latent = self.field.encode(torch.as_tensor(shape.points[:ENCODER_POINTS])[None])
        target = Target(self.field, latent, shape.distance, shape.floor_height, self.field.front(latent)[0])
        solve = self._solve_paper if request.solver == "paper" else self._solve_default
        pair, found = solve(shape, target, pairs, request, watch)
        return self._result(shape, target, pair, found, request, time.perf_counter() - started)

    def _chosen(self, request: GoalPoseRequest) -> list[ReferencePair]:
        if request.solver not in SOLVERS:
            raise RequestError("solver", f"solver is {request.solver!r}; it must be one of {', '.join(SOLVERS)}")
        if request.reference is not None:
            if request.reference not in self.references:
                known = ", ".join(self.references)
                raise RequestError("reference_pose", f"no reference pose {request.reference!r}; there are {known}")
            return [self.references[request.reference]]
        if request.action not in ACTIONS:
            raise RequestError("action", f"action is {request.action!r}; it must be one of {', '.join(ACTIONS)}")
        return [pair for pair in self.references.values() if pair.action == request.action]

    def model(self, pair: ReferencePair, seed: int, samples: int) -> ReferenceModel:
        """The energy's view of a reference pair, computed once."""
        key = (pair.id, seed, samples)
        with self._lock:
            if key not in self._models:
                self._models[key] = model_reference(pair, self.field, samples=samples, seed=seed, points=ENCODER_POINTS)
            return self._models[key]

    def _stacked(self, pairs: list[ReferencePair], seed: int, samples: int) -> ReferenceModel:
        """Several reference pairs as one model."""
        return models_stack([self.model(pair, seed, samples) for pair in pairs])

    def _solve_default(
        self, shape: Shape, target: Target, pairs: list[ReferencePair], request: GoalPoseRequest, watch: Watch
    ) -> tuple[ReferencePair, Candidates]:
        places = find_places(shape)
        if not len(places):
            places = torch.tensor(shape.bounds.mean(0), dtype=torch.float32)[None]
        found = solve(
            self._stacked(pairs, request.seed, self.config.samples),
            target,
            self.config,
            places=places,
            initial_yaw=request.initial_yaw or 0.0,
            watch=watch,
            keep=request.restarts,
        )
        return pairs[int(found.reference[0])], found

    def _solve_paper(
        self, shape: Shape, target: Target, pairs: list[ReferencePair], request: GoalPoseRequest, watch: Watch
    ) -> tuple[ReferencePair, Candidates]:
        """The published schedule on the first pair: it has no rule for choosing one."""
        model = self.model(pairs[0], request.seed, self.paper.samples)
        config = replace(self.paper, headings=request.restarts) if request.restarts else self.paper
        return pairs[0], solve_paper(model, target, shape, config, initial_yaw=request.initial_yaw or 0.0, watch=watch)

    def _result(
        self,
        shape: Shape,
        target: Target,
        pair: ReferencePair,
        found: Candidates,
        request: GoalPoseRequest,
        seconds: float,
    ) -> GoalPoseResult:
        samples = self.paper.samples if request.solver == "paper" else self.config.samples
        values = diagnose(found.figure, self.model(pair, request.seed, samples), target)
        energies = {name: float(term[0]) for name, term in found.terms.items()} | {"total": float(found.energy[0])}
        yaws = facing_yaw(found.figure)
        summaries = [
            CandidateSummary(float(e), (float(r[0]), float(r[1]), float(r[2])), float(y))
            for e, r, y in zip(found.energy, found.figure.root_position, yaws, strict=True)
        ]
        return GoalPoseResult(
            name=self._name(shape, request),
            pose=found.pose(),
            energies=energies,
            diagnostics=values,
            warnings=warn(values),
            reference=pair.id,
            action=pair.action,
            floor_height=shape.floor_height,
            object=shape.name,
            seconds=seconds,
            candidates=tuple(summaries),
        )

    def _name(self, shape: Shape, request: GoalPoseRequest) -> str:
        parts = [
            shape.name,
            asdict(request),
            self.field_name,
            str(self.config),
            str(self.paper),
            sorted(self.references),
        ]
        return "goalPoses/sha256:" + hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
