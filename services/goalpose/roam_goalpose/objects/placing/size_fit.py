"""Fit `size`: `python -m roam_goalpose.objects.placing.size_fit --objects DIR [DIR ...] [--held-out DIR]`.

DIR holds GLB files of furniture that stand on y = 0 in metres. Prints how far the predicted height is from the real one
in ten-fold cross-validation and in the held-out folder, and writes `size.npz`. A minute for 500 objects.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roam_goalpose.objects.geometry import Array
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.placing import size
from roam_goalpose.objects.placing.size import GaussianProcess, describe_shape
from roam_goalpose.objects.reading import read_geometry
from roam_goalpose.objects.surfaces.surface import surface_samples

_FOLDS = 10
_OUT = Path(size.__file__).with_name("size.npz")


def main(argv: Sequence[str] | None = None) -> None:
    """Read the folders, cross-validate, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", nargs="+", type=Path, required=True)
    parser.add_argument("--held-out", type=Path)
    parser.add_argument("--out", type=Path, default=_OUT)
    options = parser.parse_args(argv)
    shapes, heights = _described([file for folder in options.objects for file in sorted(folder.glob("*.glb"))])
    print(_errors("cross-validation", cross_validated(shapes, heights) - heights))
    if options.held_out:
        other, real = _described(sorted(options.held_out.glob("*.glb")))
        fitted = GaussianProcess.fit(shapes, heights)
        print(_errors("held out", np.array([fitted.predict(one).log_height for one in other]) - real))
    np.savez_compressed(options.out, shapes=shapes.astype(np.float32), log_heights=heights.astype(np.float32))


def cross_validated(shapes: Array, log_heights: Array) -> Array:
    """Of every object `[N]` the log height that a fit without its fold expects."""
    fold = np.random.default_rng(0).integers(0, _FOLDS, len(shapes))
    expected = np.zeros(len(shapes))
    for k in range(_FOLDS):
        fitted = GaussianProcess.fit(shapes[fold != k], log_heights[fold != k])
        expected[fold == k] = [fitted.predict(one).log_height for one in shapes[fold == k]]
    return expected


def _described(files: Sequence[Path]) -> tuple[Array, Array]:
    """Shapes `[N, K]` and log heights `[N]`."""
    shapes, heights = [], []
    for file in files:
        geometry = read_geometry(file.read_bytes(), "glb", Limits())
        shapes.append(describe_shape(*surface_samples(geometry), np.eye(3)))
        heights.append(np.log(np.ptp(geometry.vertices[:, 1])))
    return np.array(shapes), np.array(heights)


def _errors(name: str, errors: Array) -> str:
    wrong = float((np.abs(errors) > np.log(2.54) / 2).mean())
    return (
        f"{name}: {len(errors)} objects, log height off by {errors.std():.3f} (rms), "
        f"{100 * wrong:.1f} % nearer to centimetres taken for inches than to the truth"
    )


if __name__ == "__main__":
    main()
