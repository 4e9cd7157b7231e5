"""The coarse rigid search: every resting place times every heading in one batch, ranked by geometry, then by all."""

import math
from dataclasses import replace

import torch
from character.rotation import quat_from_yaw, quat_mul, quat_rotate
from torch import Tensor

from goalpose.candidates import Candidates, candidates_concat, distinct
from goalpose.energy.figure import Figure, figure_concat, figure_from_pose
from goalpose.energy.total import ReferenceModel, Settings, Target, total_energy, without_descriptor
from goalpose.legs import settle_legs
from goalpose.progress import Watch


def headings(count: int, first: float) -> Tensor:
    """`count` evenly spaced turns about +Y [rad], beginning with `first`."""
    return first + torch.arange(count) * (2 * math.pi / count)


def placed_figures(model: ReferenceModel, places: Tensor, turns: Tensor, floor_height: float) -> Figure:
    """The one reference of `model`, turned and put with the hip above each place, legs settled to the floor.

    `places` [K, 3] surface points [m], `turns` [H] [rad] on top of the reference's own heading. -> K * H poses.
    """
    root = places + torch.tensor([0.0, float(model.hip_height), 0.0])
    upright = model.figure.rotations.expand(len(places), -1, -1)
    settled = figure_from_pose(model.skeleton, root, upright)
    soles = model.contacts.joint[model.contacts.on_floor]
    if len(soles):
        ankle = float(model.figure.positions[0, soles, 1].max() - model.floor_height)
        settled = settle_legs(settled, floor_height, ankle_height=ankle)
    return turned_figures(settled, turns)


def turned_figures(figure: Figure, turns: Tensor) -> Figure:
    """Every pose turned about its own root by every angle. [B] x [H] -> B * H poses."""
    count, heads = len(figure), len(turns)
    turn = quat_from_yaw(turns)[None, :, None]  # [1, H, 1, 4]
    root = figure.root_position[:, None, None]
    positions = root + quat_rotate(
        turn.expand(count, -1, figure.positions.shape[1], -1),
        (figure.positions[:, None] - root).expand(-1, heads, -1, -1),
    )
    orientations = quat_mul(turn, figure.orientations[:, None])
    rotations = figure.rotations[:, None].expand(-1, heads, -1, -1).clone()
    rotations[:, :, :1] = orientations[:, :, :1]
    return Figure(
        figure.skeleton,
        root.expand(-1, heads, -1, -1).reshape(-1, 3),
        rotations.flatten(0, 1),
        positions.flatten(0, 1),
        orientations.flatten(0, 1),
    )


@torch.no_grad()
def evaluate(
    figure: Figure, reference: Tensor, model: ReferenceModel, target: Target, settings: Settings, *, chunk: int = 1024
) -> Candidates:
    """Energies of many poses made from the references `reference` [B], in chunks to bound the memory."""
    parts = []
    for start in range(0, len(figure), chunk):
        now = slice(start, start + chunk)
        energy, terms = total_energy(figure[now], model.of(reference[now]), target, settings)
        parts.append(Candidates(figure[now], reference[now], energy, terms))
    return candidates_concat(parts)


def coarse_search(
    model: ReferenceModel,
    target: Target,
    settings: Settings,
    *,
    places: Tensor,
    turns: Tensor,
    shortlist: int,
    apart: float,
    watch: Watch,
) -> Candidates:
    """Rigid placements of every reference: the `shortlist` best of each by geometry, with the whole energy."""
    # Rigid moves hardly change the terms of the body alone; contacts and penetration imply the clearance.
    cheap = replace(
        without_descriptor(settings).weights,
        prior=0.0,
        angle_limit=0.0,
        gravity=0.0,
        self_collision=0.0,
        floor=0.0,
        clearance=0.0,
    )
    figures, references = [], []
    for index in range(len(model)):
        watch.check()
        one = model[slice(index, index + 1)]
        figure = placed_figures(one, places, turns, target.floor_height)
        reference = torch.full((len(figure),), index)
        if cheap.contact or cheap.penetration:
            found = evaluate(figure, reference * 0, one, target, replace(settings, weights=cheap))
            chosen = distinct(found, shortlist, reach=apart, angle=0.3)
            figure, reference = figure[chosen], reference[chosen]
        figures.append(figure)
        references.append(reference)
    return evaluate(figure_concat(figures), torch.cat(references), model, target, settings)
