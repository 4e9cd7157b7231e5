"""`roam evaluate goalpose ablation`: what every part of method and energy is worth (paper Fig. 6, Fig. 9 and D).

    roam evaluate goalpose ablation --objects DIR --json FILE [--plot FILE.png] [--variants …] [--limit 24]

Variants of the default solver: stages, terms, and where the descriptors are sampled. Objects and references are the
same for all of them.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from roam_goalpose.energy.reference import LargePerReference, ReferenceModel
from roam_goalpose.energy.terms import TERMS
from roam_goalpose.energy.terms.descriptor import Descriptor, ReferenceDescriptors
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.solvers.staged import SolverConfig
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer

from roam_evaluation.goalpose.figures.plots import plot_penetration
from roam_evaluation.goalpose.inputs.cases import plain_case
from roam_evaluation.goalpose.inputs.objects import EvaluationObject, add_object_options, chosen_objects
from roam_evaluation.goalpose.runs import run_case
from roam_evaluation.goalpose.scores import summarise_variants
from roam_evaluation.goalpose.study import run_study, shipped
from roam_evaluation.shared.ledger import Ledger, Record

Change = Callable[[SolverConfig], SolverConfig]
OUR_TERMS = tuple(term.name for term in TERMS.values() if term.published is None and term.weight)


def _without(*terms: str) -> Change:
    return lambda config: replace(config, weights=config.weights.without(*terms))


def _all_stages_at_once(config: SolverConfig) -> SolverConfig:
    """All unknowns are free from the first step; the number of steps stays."""
    return replace(config, rigid=replace(config.rigid, joints=True))


def _samples(count: int) -> Change:
    return lambda config: replace(
        config, joints=replace(config.joints, samples=count), finish=replace(config.finish, samples=count)
    )


CHANGES: dict[str, Change] = {
    "default": lambda config: config,
    "all stages at once": _all_stages_at_once,
    "without E_a": _without("angle_limit"),
    "without E_r": _without("prior"),
    "without E_a, E_r": _without("angle_limit", "prior"),
    "joint sampling": _samples(1),
    "bone sampling": _samples(1),
    "10 samples per cloud": _samples(10),
    "without descriptor": _without("descriptor"),
    **{f"without {term}": _without(term) for term in OUR_TERMS},
    "the paper's terms": _without(*OUR_TERMS),
}
JOINTS_ONLY = frozenset({"joint sampling"})  # no probes at the middle of the limbs


@dataclass(eq=False)
class JointSampled(Synthesizer):
    """A synthesizer whose descriptors are sampled at the joints alone."""

    def model(self, pair: ReferencePair, *rest: int) -> ReferenceModel:
        """The reference without the probes at the middle of limbs."""
        return at_joints(super().model(pair, *rest))


def at_joints(model: ReferenceModel) -> ReferenceModel:
    """A reference model whose probes lie at joints only."""
    prepared = Descriptor().of(model)
    probes = prepared.probes
    kept = torch.nonzero(probes.centre < model.skeleton.joint_count)[:, 0]
    at_joints = replace(
        probes, joint=probes.joint[kept], offset=probes.offset[kept], centre=probes.centre[kept], knee=probes.knee[kept]
    )
    values = LargePerReference.of(prepared.descriptors.values[:, kept])
    found = ReferenceDescriptors(at_joints, values, prepared.nearness[:, kept])
    return replace(model, prepared={**model.prepared, Descriptor.name: found})


def ablated(synthesizer: Synthesizer, variant: str) -> Synthesizer:
    """The synthesizer with one change; reference models are not shared, because they may differ."""
    kind = JointSampled if variant in JOINTS_ONLY else Synthesizer
    config = CHANGES[variant](synthesizer.config)
    return kind(synthesizer.field, synthesizer.references, synthesizer.field_name, config)


def evaluate_object(synthesizer: Synthesizer, item: EvaluationObject, variants: dict[str, Synthesizer]) -> list[Record]:
    """A run per variant, all with the reference that the default chooses."""
    case = plain_case(item)
    first = run_case(synthesizer, case, GoalPoseRequest(), variant="default")
    runs = [first]
    for variant, made in variants.items():
        if variant != "default":
            runs.append(run_case(made, case, GoalPoseRequest(reference=first.reference), variant=variant))
    print(f"{item.category:12} {item.name[:46]:46} {first.line()}", file=sys.stderr, flush=True)
    return [run.record() for run in runs]


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose ablation", description=__doc__.split("\n")[0])
    add_object_options(parser)
    parser.add_argument("--variants", nargs="+", choices=tuple(CHANGES), default=tuple(CHANGES), metavar="VARIANT")
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    parser.add_argument("--plot", type=Path, help="penetration curves (PNG)")
    parser.add_argument("--minutes", type=float, help="start no new object after this")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    ledger = Ledger(
        options.json, {"variants": list(options.variants)}, summarise=summarise_variants, minutes=options.minutes
    )
    synthesizer = shipped(None)
    made = {variant: ablated(synthesizer, variant) for variant in options.variants}
    run_study(ledger, chosen_objects(options), evaluate_object, made, load=lambda _: synthesizer)
    summary = ledger.report()["summary"]
    for variant, figures in summary.items():
        print(
            f"{variant:22} success {100 * figures['success']:5.1f} %  strict {100 * figures['strict']:5.1f} %  "
            f"penetration AUC {figures['penetration_auc']:.3f}  CPU {figures['cpu_seconds']['median']:.2f} s"
        )
    if options.plot:
        plot_penetration(options.plot, summary)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
