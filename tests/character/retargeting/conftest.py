"""Fitted characters, and a motion that bends every joint."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "rigs"))

from rig_maker import character
from roam_character.clip import Clip
from roam_character.retargeting.proportions import Fit, fit
from roam_character.rigs.mapping import map_bones
from roam_character.rigs.reading import read_rig
from roam_character.rotation import quat_from_rotvec
from roam_character.skeleton import Skeleton


@pytest.fixture
def fitted(tmp_path: Path) -> Callable[..., Fit]:
    """A fitted character from a file that `character(**options)` makes."""

    def make(*, height: float | None = None, **options: object) -> Fit:
        path = tmp_path / "hero.glb"
        path.write_bytes(character(**options).to_bytes())  # type: ignore[arg-type]
        rig = read_rig(path)
        return fit(rig, map_bones(rig), height=height)

    return make


@pytest.fixture
def bending() -> Callable[[Skeleton], Clip]:
    """Half a second in which every joint of a skeleton turns by up to 60 degrees."""

    def make(skeleton: Skeleton) -> Clip:
        rng = np.random.default_rng(5)
        waves = rng.normal(0, 0.5, (1, skeleton.joint_count, 3)) * np.sin(np.linspace(0, 3, 15))[:, None, None]
        roots = np.array([0.2, 0.9, -0.4]) + np.linspace(0, 1, 15)[:, None] * [1, 0, 2]
        return Clip(skeleton, 30.0, roots.astype(np.float32), quat_from_rotvec(waves).astype(np.float32))

    return make
