"""Motion models by the key that their weights files carry. A further model is a module of its own and one line here.

A weights file is safetensors: its metadata name the `model` and the `skeleton` that it was trained for; all else is the
model's own.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from safetensors import safe_open
from torch import Tensor

from roam_motion.animation.blending import Blending
from roam_motion.animation.figure import Figure
from roam_motion.animation.prediction import Predict
from roam_motion.models.lnsm import predict as lnsm


class MotionModel(Protocol):
    """What predicts the next frame of characters on one skeleton."""

    @property
    def figure(self) -> Figure:
        """The skeleton."""

    @property
    def starts(self) -> Mapping[str, Tensor]:
        """Stances that characters start from: "height" [S] of the hips [m], "orientations" [S, J, 3, 3] facing +Z."""

    @property
    def blending(self) -> Blending:
        """How its answers meet the goal."""

    def predictor(self) -> Predict:
        """What is asked for every frame; called once, and traced."""


Load = Callable[[Figure, Mapping[str, str], Mapping[str, Tensor]], MotionModel]  # figure, metadata, tensors

MODELS: dict[str, Load] = {lnsm.KEY: lnsm.load}


def register(key: str, load: Load) -> None:
    """Makes a model known under a key. ValueError when it is taken."""
    if key in MODELS:
        raise ValueError(f"a motion model {key!r} is there already")
    MODELS[key] = load


def load_model(weights: str | Path, figure: Figure) -> MotionModel:
    """The model of a weights file; one without a key is an l-NSM.

    ValueError when its key is not known, or it was trained for another skeleton.
    """
    with safe_open(str(weights), "pt") as file:
        metadata: dict[str, str] = file.metadata() or {}
        tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
    if metadata.get("skeleton") != figure.skeleton.id:
        raise ValueError(f"{weights} was trained for skeleton {metadata.get('skeleton')}, not {figure.skeleton.id}")
    key = metadata.get("model", lnsm.KEY)
    if key not in MODELS:
        raise ValueError(f"{weights} is of the motion model {key!r}; this build knows {', '.join(MODELS)}")
    return MODELS[key](figure, metadata, tensors)
