"""Fit `upright`: `python -m roam_goalpose.objects.placing.upright_fit --objects DIR [DIR ...] [--held-out DIR]`.

DIR holds GLB files that stand on y = 0 in metres. Every object, at a few sizes and with and without a mesh's normals,
must score higher as it stands than upside down, lying on any of its four sides (how a file with another up axis looks)
or on any other plane that it can stand on (how one looks that was turned at random). Prints how many objects are set on
their feet among those planes, in cross-validation and in the held-out folder, and writes the model that `upright` uses.
Minutes for 500 objects.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from roam_goalpose.objects.geometry import Array, Geometry, triangle_areas
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.placing import upright
from roam_goalpose.objects.placing.axes import up_rotation
from roam_goalpose.objects.placing.tilt import possible_ups, stands, surface_centre, turn_to_y
from roam_goalpose.objects.placing.upright import describe, products
from roam_goalpose.objects.reading import read_geometry
from roam_goalpose.objects.surfaces.sampling import sample_triangles, shuffled_subset
from roam_goalpose.objects.surfaces.surface import local_normals

_SIDES = ("z", "-z", "x", "-x", "-y")
_FOLDS = 5
_RIDGE = 30.0
_SAME = math.cos(math.radians(12))  # planes closer to upright than this are not wrong

_OUT = Path(upright.__file__).with_name("upright.json")

Candidates = Array  # [C, K] features of one object in one variant, as it stands first


@dataclass(frozen=True, eq=False)
class Model:
    """What `upright` reads."""

    mean: Array  # [K]
    deviation: Array  # [K]
    weights: Array  # [K + K (K + 1) / 2]

    def products(self, candidates: Candidates) -> Array:
        """What the weights are for."""
        return products((candidates - self.mean) / self.deviation)


def main() -> None:
    """Read the folders, cross-validate, fit on everything but the held-out folder, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", nargs="+", type=Path, required=True)
    parser.add_argument("--held-out", type=Path)
    parser.add_argument("--out", type=Path, default=_OUT)
    options = parser.parse_args()
    files = sorted(file for folder in options.objects for file in folder.glob("*.glb"))
    objects = [_candidates(file) for file in files]
    fold = np.random.default_rng(0).integers(0, _FOLDS, len(files))
    right = []
    for k in range(_FOLDS):
        model = fit([one for one, its in zip(objects, fold, strict=True) if its != k])
        right.append(accuracy([one for one, its in zip(objects, fold, strict=True) if its == k], model))
    print(f"{len(files)} objects, {_FOLDS}-fold cross-validation: {np.mean(right):.4f} set on their feet")
    model = fit(objects)
    if options.held_out:
        held_out = [_candidates(file) for file in sorted(options.held_out.glob("*.glb"))]
        print(f"{len(held_out)} held-out objects: {accuracy(held_out, model):.4f} set on their feet")
    options.out.write_text(json.dumps({name: part.tolist() for name, part in vars(model).items()}, indent=1) + "\n")


def fit(objects: Sequence[Sequence[Candidates]]) -> Model:
    """The model that ranks the first row of every variant highest."""
    rows = np.concatenate([candidates for variants in objects for candidates in variants])
    scaling = Model(rows.mean(axis=0), rows.std(axis=0) + 1e-9, np.zeros(0))
    weights = fit_weights([[scaling.products(c) for c in variants] for variants in objects], ridge=_RIDGE)
    return replace(scaling, weights=weights)


def fit_weights(objects: Sequence[Sequence[Candidates]], *, ridge: float) -> Array:
    """Logistic ranking: weights `[K]` that put the first row of every variant above its other rows.

    Every variant counts alike, however many rows it has; the `ridge` is for features of deviation 1.
    """
    variants = [candidates for variants in objects for candidates in variants]
    scale = np.concatenate(variants).std(axis=0) + 1e-9
    gaps = np.concatenate([candidates[:1] - candidates[1:] for candidates in variants]) / scale
    share = np.concatenate([np.full(len(c) - 1, 1 / max(len(c) - 1, 1)) for c in variants]) / len(variants)

    def loss(weights: Array) -> tuple[float, Array]:
        margins = gaps @ weights
        wrong = share / (1.0 + np.exp(np.clip(margins, -50, 50)))
        value = share @ np.logaddexp(0, -margins) + ridge * weights @ weights / len(gaps)
        return float(value), -(wrong @ gaps) + 2 * ridge * weights / len(gaps)

    fitted: Array = minimize(loss, np.zeros(gaps.shape[1]), jac=True, method="L-BFGS-B").x
    return fitted / scale


def accuracy(objects: Sequence[Sequence[Candidates]], model: Model) -> float:
    """Share of variants whose first row scores highest."""
    ranked = [(model.products(c) @ model.weights).argmax() for variants in objects for c in variants]
    return float(np.mean(np.array(ranked) == 0))


def _candidates(file: Path) -> list[Candidates]:
    """Of every variant of an object what it looks like in every position."""
    geometry = read_geometry(file.read_bytes(), "glb", Limits())
    vertices, centre = geometry.vertices, surface_centre(geometry.triangles)
    turns = [np.eye(3), *(up_rotation(side) for side in _SIDES)]
    planes = [(up, turn_to_y(up)) for up in possible_ups(vertices) if up[1] < _SAME]
    turns += [turn for _, turn in planes if stands(vertices @ turn.T, turn @ centre)]
    return [np.array([describe(*variant, turn) for turn in turns]) for variant in _variants(geometry)]


def _variants(geometry: Geometry) -> list[tuple[Array, Array]]:
    """The object as it is, as a bare cloud, and at the wrong sizes that people upload."""
    areas = triangle_areas(geometry.triangles)
    samples = shuffled_subset(sample_triangles(geometry.triangles, areas, 40_000, seed=0), 20_000, seed=0)
    points, normals = samples.points, samples.normals
    assert normals is not None
    return [
        (points, normals),
        (points, local_normals(points).normals),
        (0.8 * points, normals),
        (1.25 * points, normals),
    ]


if __name__ == "__main__":
    main()
