"""From a checkpoint to the shipped file: averaged network, normaliser, start poses; one safetensors file."""

import json
from pathlib import Path

import torch
from safetensors.torch import save_file

from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.models.lnsm import predict as lnsm
from roam_motion.models.lnsm.config import network_config
from roam_motion.training.data.dataset import Dataset

_TALL = 0.92  # [m], for legs of 0.82 m: hips higher than this stand upright
_STARTS = 8  # quiet standing poses that a new character may start from


def start_poses(figure: Figure, dataset: Dataset) -> dict[str, torch.Tensor]:
    """Hips heights [S] and world orientations [S, J, 3, 3] (facing +Z, over the origin) of quiet standing frames."""
    still = (
        (dataset.styles[:, 0] > 0.999)
        & (dataset.hips[:, 1] > _TALL * size(figure))
        & (dataset.contacts[:, [0, 2]].amin(1) > 0.5)
    )
    rows = still.nonzero()[:, 0]
    before = figure.positions(dataset.hips[rows - 1], dataset.orientations[rows - 1])
    now = figure.positions(dataset.hips[rows], dataset.orientations[rows])
    speed = (now - before).norm(dim=-1).amax(-1)
    hands = now[:, figure.skeleton.indices(["leftHand", "rightHand"]), 1].amax(-1)
    heads = now[:, figure.skeleton.index("head"), 1]
    score = speed + 0.2 * hands - 0.3 * heads  # still, arms hanging, upright
    rows = rows[score.argsort()[: 50 * _STARTS : 50]]
    frame = figure.frame(figure.positions(dataset.hips[rows], dataset.orientations[rows]))
    columns = [frame.turn_in(dataset.orientations[rows][..., i]) for i in range(3)]
    return {"start.height": dataset.hips[rows, 1].clone(), "start.orientations": torch.stack(columns, -1).contiguous()}


def export(checkpoint: Path, path: Path, figure: Figure, dataset: Dataset) -> dict[str, object]:
    """Writes the averaged weights of `checkpoint` to `path`; returns its scores."""
    state = torch.load(checkpoint, weights_only=True)
    network = state["averaged"]
    tensors = {f"network.{k}": v.contiguous() for k, v in network.items()}
    tensors |= {f"normaliser.{k}": v.contiguous() for k, v in state["normaliser"].items()}
    tensors |= start_poses(figure, dataset)
    sizes = {
        "experts": network["first.weight"].shape[0],
        "encoding": network["first.weight"].shape[1] // 2,
        "hidden": network["first.weight"].shape[2],
    }
    config = network_config(figure.joint_count, **sizes).as_dict()
    metadata = {
        "model": lnsm.KEY,
        "config": json.dumps(config),
        "skeleton": figure.skeleton.id,
        "updates": str(state["updates"]),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    save_file(tensors, path, metadata)
    scores: dict[str, object] = dict(state["scores"])
    return scores
