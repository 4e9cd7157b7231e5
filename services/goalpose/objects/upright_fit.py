"""Fit the weights of `upright`: `python -m goalpose.objects.upright_fit --objects DIR [DIR ...] [--held-out DIR]`.

DIR holds GLB files that stand on y = 0 in metres. Every object, at a few sizes and with and without a mesh's normals,
must score higher with +Y up than lying on any of its four sides: that is how a file with another up axis looks. Prints
cross-validated accuracy, accuracy on the held-out folder, and the weights to paste into `upright`.
Minutes for 500 objects.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from goalpose.objects.geometry import Array
from goalpose.objects.limits import Limits
from goalpose.objects.reading import read_geometry
from goalpose.objects.sampling import sample_triangles, shuffled_subset, triangle_areas
from goalpose.objects.surface import local_normals
from goalpose.objects.upright import WEIGHTS, describe

_UP_THEN_LYING = ("y", "z", "-z", "x", "-x")
_FOLDS = 5
_RIDGE = 1.0


def main() -> None:
    """Read the folders, cross-validate, fit on everything but the held-out folder, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", nargs="+", type=Path, required=True)
    parser.add_argument("--held-out", type=Path)
    options = parser.parse_args()
    files = sorted(file for folder in options.objects for file in folder.glob("*.glb"))
    features = _features(files)
    scale = features.std(axis=(0, 1, 2)) + 1e-9
    fold = np.random.default_rng(0).integers(0, _FOLDS, len(files))
    right = [
        _accuracy(features[fold == k] / scale, fit_weights(features[fold != k] / scale, ridge=_RIDGE))
        for k in range(_FOLDS)
    ]
    print(
        f"{len(files)} objects, {_FOLDS}-fold cross-validation: {np.concatenate(right).mean():.4f} of comparisons right"
    )
    weights = fit_weights(features / scale, ridge=_RIDGE)
    if options.held_out:
        held_out = sorted(options.held_out.glob("*.glb"))
        share = _accuracy(_features(held_out) / scale, weights).mean()
        print(f"{len(held_out)} held-out objects: {share:.4f} right")
    for name, weight in zip(WEIGHTS, weights / scale, strict=True):
        print(f'    "{name}": {weight:.4g},')


def fit_weights(features: Array, *, ridge: float) -> Array:
    """Logistic ranking: weights `[K]` that put column 0 of `[N, V, 5, K]` above the other columns."""
    gaps = (features[:, :, :1] - features[:, :, 1:]).reshape(-1, features.shape[-1])

    def loss(weights: Array) -> tuple[float, Array]:
        margins = gaps @ weights
        wrong = 1.0 / (1.0 + np.exp(np.clip(margins, -50, 50)))
        value = np.logaddexp(0, -margins).mean() + ridge * weights @ weights / len(gaps)
        return float(value), -(gaps * wrong[:, None]).mean(axis=0) + 2 * ridge * weights / len(gaps)

    fitted: Array = minimize(loss, np.zeros(features.shape[-1]), jac=True, method="L-BFGS-B").x
    return fitted


def _accuracy(features: Array, weights: Array) -> Array:
    scores = features @ weights
    right: Array = (scores[:, :, :1] > scores[:, :, 1:]).astype(float)
    return right


def _features(files: Sequence[Path]) -> Array:
    """`[objects, variants, directions, K]`."""
    return np.array(
        [[[describe(*variant, up) for up in _UP_THEN_LYING] for variant in _variants(file)] for file in files]
    )


def _variants(file: Path) -> list[tuple[Array, Array]]:
    """The object as it is, as a bare cloud, and at the wrong sizes that people upload."""
    geometry = read_geometry(file.read_bytes(), "glb", Limits())
    areas = triangle_areas(geometry.triangles)
    samples = shuffled_subset(sample_triangles(geometry.triangles, areas, 40_000, seed=0), 20_000, seed=0)
    points, normals = samples.points, samples.normals
    assert normals is not None
    return [
        (points, normals),
        (points, local_normals(points).normals),
        (0.65 * points, normals),
        (1.5 * points, normals),
    ]


if __name__ == "__main__":
    main()
