"""Plots of the goal pose studies."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from roam_evaluation.shared.ledger import Record

GREY, BLUE, ORANGE = "0.75", "tab:blue", "tab:orange"


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def plot_bars(path: Path, shares: Mapping[str, tuple[float, float]], labels: tuple[str, str]) -> None:
    """Two shares for every variant, as bars from the left."""
    figure, axes = plt.subplots(figsize=(7, 0.28 * len(shares) + 1.2))
    rows = np.arange(len(shares))[::-1]
    for k, (label, colour) in enumerate(zip(labels, (GREY, BLUE), strict=True)):
        axes.barh(rows, [100 * pair[k] for pair in shares.values()], height=0.8 - 0.35 * k, color=colour, label=label)
    axes.set_yticks(rows, list(shares), fontsize=8)
    axes.set_xlim(0, 100)
    axes.set_xlabel("poses [%]")
    axes.legend(loc="lower left", fontsize=8)
    _save(figure, path)


def plot_distances(path: Path, records: Sequence[Record], changes: Sequence[str]) -> None:
    """Every change against the Chamfer distance to the reference object."""
    figure, axes = plt.subplots(1, len(changes), figsize=(4 * len(changes), 3.2), squeeze=False)
    kinds = sorted({record["category"] for record in records})
    for panel, name in zip(axes[0], changes, strict=True):
        for kind in kinds:
            chosen = [record for record in records if record["category"] == kind]
            panel.scatter([100 * r["chamfer_m"] for r in chosen], [r[name] for r in chosen], s=14, label=kind)
        panel.set_xlabel("Chamfer distance to the reference object [cm]")
        panel.set_ylabel(name.replace("_", " "))
        panel.set_ylim(bottom=0)
    axes[0][0].legend(fontsize=8)
    _save(figure, path)


def plot_penetration(path: Path, summary: Mapping[str, Any]) -> None:
    """Share of poses without a capsule deeper than t against t, one curve per variant."""
    figure, axes = plt.subplots(figsize=(7, 4.2))
    colours = plt.get_cmap("tab20")
    for k, (variant, figures) in enumerate(summary.items()):
        curve = figures["penetration_curve"]
        depths = [100 * float(t) for t in curve]
        label = f"{variant} ({figures['penetration_auc']:.2f})"
        axes.plot(
            depths, [100 * s for s in curve.values()], color=colours(k % 20), lw=2.4 if k == 0 else 1.2, label=label
        )
    axes.set_xlabel("depth t allowed [cm]")
    axes.set_ylabel("poses no deeper than t [%]")
    axes.set_ylim(0, 101)
    axes.legend(fontsize=7, loc="lower right", title="area under the curve in brackets", title_fontsize=7)
    _save(figure, path)


def plot_drift(path: Path, curves: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> None:
    """Share of poses that drift less than a threshold: (thresholds [m], shares) per curve."""
    figure, axes = plt.subplots(figsize=(5, 3.4))
    for label, (thresholds, shares) in curves.items():
        axes.plot([100 * t for t in thresholds], [100 * s for s in shares], label=label)
    axes.axvline(10, color=GREY, lw=1)
    axes.set_xlabel("drift allowed in 1 s [cm]")
    axes.set_ylabel("share [%]")
    axes.set_ylim(0, 101)
    axes.legend(fontsize=8, loc="lower right")
    _save(figure, path)
