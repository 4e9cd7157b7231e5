"""The application object: an object and a request in, a goal pose with energies, diagnostics and warnings out."""

import dataclasses
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from threading import Lock
from typing import Any

import torch
from roam_character.retarget import RetargetError
from roam_character.skeleton import Skeleton
from roam_serving.cache import RecentCache
from roam_serving.shipped import REFERENCES, WEIGHTS

from roam_goalpose.assessment.result import GoalPoseResult, RankedPose, choose_diverse, ranked_pose, summaries
from roam_goalpose.energy.constraints import NONE, Constraints, constraints_in
from roam_goalpose.energy.object import DescriptorField
from roam_goalpose.energy.reference import ReferenceModel, models_stack
from roam_goalpose.energy.scene import Target
from roam_goalpose.energy.terms import TERMS, published_weights
from roam_goalpose.field.field import Field
from roam_goalpose.objects import Shape
from roam_goalpose.objects.own_axes import Placement, in_own_axes
from roam_goalpose.references.bodies import fitted
from roam_goalpose.references.kept_models import KeptModels
from roam_goalpose.references.model import StudiedPair, model_reference, study_pair
from roam_goalpose.references.pairs import ACTIONS, ReferencePair, load_references
from roam_goalpose.solvers.candidates import Candidates
from roam_goalpose.solvers.paper import PaperConfig, solve_paper
from roam_goalpose.solvers.progress import Listener, Progress, Watch
from roam_goalpose.solvers.search import find_places
from roam_goalpose.solvers.sharing import SharedSteps
from roam_goalpose.solvers.staged import SolverConfig, solve

__all__ = [
    "SOLVERS",
    "GoalPoseRequest",
    "GoalPoseResult",
    "RankedPose",
    "RequestError",
    "Synthesizer",
    "SynthesizerSettings",
]

SOLVERS = ("default", "paper")
ENCODER_POINTS = 1500
MODELS = 96  # reference models remembered: the shipped pairs for some skeletons and seeds


class RequestError(ValueError):
    """A request that cannot be served; names the field at fault."""

    def __init__(self, field_name: str, message: str) -> None:
        super().__init__(message)
        self.field = field_name


@dataclass(frozen=True, kw_only=True)
class SynthesizerSettings:
    """Where the weights and reference pairs are."""

    weights: Path = WEIGHTS / "field.safetensors"
    references: Path = REFERENCES


@dataclass(frozen=True, kw_only=True)
class GoalPoseRequest:
    """What to adapt and how. Give `reference` (an id) or leave it to the fit by `action`."""

    reference: str | None = None
    action: str = "sit"
    # [rad] first initial heading of solver=paper; None: the reference's own. The default solver looks at every heading,
    # counted from the object's own front, so that where a search begins cannot change its answer.
    initial_yaw: float | None = None
    restarts: int = 0  # placements that are optimised (paper: initial headings); 0: the default
    seed: int = 0
    solver: str = "default"
    count: int = 1  # poses wanted: the best, then others that differ from it in place, heading or posture
    constraints: Constraints = NONE  # where to sit, face and put the hands
    weights: tuple[tuple[str, float], ...] = ()  # energy terms that weigh otherwise than the default solver says
    pair: ReferencePair | None = None  # a pair of the caller's own, instead of a shipped one
    skeleton: Skeleton | None = None  # who sits; None: the one of the reference pairs

    def weight_of(self, term: str) -> float:
        """What a term of the energy weighs, unless the synthesizer's own configuration says otherwise."""
        if self.solver == "paper":
            return published_weights()[term]
        return dict(self.weights).get(term, TERMS[term].weight)

    @property
    def key(self) -> dict[str, Any]:
        """What the answer depends on, as JSON."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("pair", "skeleton")}
        values["constraints"] = asdict(self.constraints)
        values["pair"] = None if self.pair is None else self.pair.id
        values["skeleton"] = None if self.skeleton is None else self.skeleton.id
        return values


@dataclass(eq=False)
class Synthesizer:
    """Field, reference pairs and what was computed of them; threads that share it share their Newton steps too."""

    field: DescriptorField
    references: dict[str, ReferencePair]
    field_name: str = "field"
    config: SolverConfig = dataclasses.field(default_factory=SolverConfig)
    paper: PaperConfig = dataclasses.field(default_factory=PaperConfig)
    _models: RecentCache[tuple[str, str, int, int], ReferenceModel] = dataclasses.field(
        default_factory=lambda: RecentCache(MODELS)
    )
    _studied: RecentCache[tuple[str, str], StudiedPair] = dataclasses.field(default_factory=lambda: RecentCache(MODELS))
    _kept: KeptModels | None = None
    _steps: SharedSteps = dataclasses.field(default_factory=SharedSteps)
    _lock: Lock = dataclasses.field(default_factory=Lock)

    @classmethod
    def load(cls, settings: SynthesizerSettings | None = None) -> "Synthesizer":
        """Reads weights and references. Raises FileNotFoundError saying which file is missing."""
        settings = settings or SynthesizerSettings()
        if not settings.weights.exists():
            raise FileNotFoundError(f"no field weights at {settings.weights}; train them with `roam train field`")
        name = f"sha256:{hashlib.sha256(settings.weights.read_bytes()).hexdigest()}"
        references = load_references(settings.references)
        return cls(Field.load(settings.weights), references, name, _kept=KeptModels(name))

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
        own, placement = in_own_axes(shape)
        watch = Watch(None if progress is None else lambda told: progress(told.placed(placement)), cancelled)
        watch.tell(lambda: Progress(0, 0, self.config.iterations, 0.0, None))
        target = self._target(own, constraints_in(request.constraints, placement))
        if request.solver == "paper":
            # No rule for choosing among references was published: the first, as it stands in the world.
            pairs, first = pairs[:1], (request.initial_yaw or 0.0) - placement.yaw
            found = self._solve_paper(own, target, pairs[0], request, first, watch)
        else:
            found = self._solve_default(own, target, pairs, request, watch)
        poses = self._ranked(found, pairs, target, placement, request)
        best = poses[0]
        return GoalPoseResult(
            name=self._name(shape, request),
            pose=best.pose,
            energies=best.energies,
            diagnostics=best.diagnostics,
            warnings=best.warnings,
            reference=best.reference,
            action=best.action,
            floor_height=shape.floor_height,
            object=shape.name,
            seconds=time.perf_counter() - started,
            candidates=summaries(found, placement),
            poses=poses,
        )

    def _target(self, own: Shape, constraints: Constraints) -> Target:
        with torch.no_grad():
            latent = self.field.encode(torch.as_tensor(own.points[:ENCODER_POINTS])[None])
        front = torch.tensor(own.front, dtype=torch.float32)
        return Target(self.field, latent, own.distance, own.floor_height, front, constraints)

    def _chosen(self, request: GoalPoseRequest) -> list[ReferencePair]:
        if request.solver not in SOLVERS:
            raise RequestError("solver", f"solver is {request.solver!r}; it must be one of {', '.join(SOLVERS)}")
        pairs = [request.pair] if request.pair is not None else self._shipped(request)
        if request.skeleton is None:
            return pairs
        try:
            return [fitted(pair, request.skeleton) for pair in pairs]
        except RetargetError as error:
            raise RequestError("skeleton", str(error)) from error

    def _shipped(self, request: GoalPoseRequest) -> list[ReferencePair]:
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
        key = (pair.id, pair.pose.skeleton.id, seed, samples)
        with self._lock:
            known = self._models.get(key)
            if known is None:
                known = self._modelled(pair, seed, samples)
                self._models.put(key, known)
            return known

    def _modelled(self, pair: ReferencePair, seed: int, samples: int) -> ReferenceModel:
        """From the file that an earlier process has left, or made now."""
        known = None if self._kept is None else self._kept.get(pair, seed=seed, samples=samples)
        if known is not None:
            return known
        made = model_reference(self._study(pair), samples=samples, seed=seed)
        if self._kept is not None:
            self._kept.put(pair, made, seed=seed, samples=samples)
        return made

    def _study(self, pair: ReferencePair) -> StudiedPair:
        """What no seed changes, computed once."""
        key = (pair.id, pair.pose.skeleton.id)
        studied = self._studied.get(key)
        if studied is None:
            studied = study_pair(pair, self.field, points=ENCODER_POINTS)
            self._studied.put(key, studied)
        return studied

    def _stacked(self, pairs: list[ReferencePair], seed: int, samples: int) -> ReferenceModel:
        """Several reference pairs as one model."""
        return models_stack([self.model(pair, seed, samples) for pair in pairs])

    def _solve_default(
        self,
        shape: Shape,
        target: Target,
        pairs: list[ReferencePair],
        request: GoalPoseRequest,
        watch: Watch,
    ) -> Candidates:
        config = replace(self.config, weights=self.config.weights.changed(dict(request.weights)))
        wishes = target.constraints
        places = find_places(shape)
        if wishes.seat_point is not None:
            places = torch.cat([places, torch.tensor(wishes.seat_point)[None]])
        if not len(places):
            places = torch.tensor(shape.bounds.mean(0), dtype=torch.float32)[None]
        models = models_stack([self.model(pair, request.seed, config.samples) for pair in pairs])
        with self._steps.taking_part(), torch.inference_mode():
            return solve(
                models,
                target,
                config.wanting(request.count),
                places=places,
                first_yaw=wishes.facing or 0.0,  # a wished heading is among those looked at; else the object's front
                watch=watch,
                keep=request.restarts,
                steps=self._steps.minimise,
            )

    def _solve_paper(
        self,
        shape: Shape,
        target: Target,
        pair: ReferencePair,
        request: GoalPoseRequest,
        first: float,
        watch: Watch,
    ) -> Candidates:
        model = self.model(pair, request.seed, self.paper.samples)
        config = replace(self.paper, headings=request.restarts) if request.restarts else self.paper
        return solve_paper(model, target, shape, config, initial_yaw=first, watch=watch)

    def _ranked(
        self,
        found: Candidates,
        pairs: list[ReferencePair],
        target: Target,
        placement: Placement,
        request: GoalPoseRequest,
    ) -> tuple[RankedPose, ...]:
        """The best poses that differ, best first."""
        samples = self.paper.samples if request.solver == "paper" else self.config.samples
        poses = []
        for index in choose_diverse(found, max(1, request.count)):
            one = found.picked(index[None])
            model = self.model(pairs[int(one.reference[0])], request.seed, samples)
            poses.append(ranked_pose(one, pairs, model, target, placement))
        return tuple(poses)

    def _name(self, shape: Shape, request: GoalPoseRequest) -> str:
        parts = [
            shape.name,
            request.key,
            self.field_name,
            str(self.config),
            str(self.paper),
            sorted(self.references),
        ]
        return "goalPoses/sha256:" + hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
