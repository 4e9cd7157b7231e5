"""The coarse rigid search: every resting place times every heading in one batch, ranked by geometry, then by all."""

import math
from dataclasses import replace

import torch
from character.rotation import quat_from_yaw, quat_mul, quat_rotate
from torch import Tensor

from goalpose.candidates import Candidates, distinct
from goalpose.energy.figure import Figure, figure_from_pose
from goalpose.energy.total import ReferenceModel, Settings, Target, total_energy, without_descriptor
from goalpose.legs import settle_legs


def headings(count: int, first: float) -> Tensor:
    """`count` evenly spaced turns about +Y [rad], beginning with `first`."""
    return first + torch.arange(count) * (2 * math.pi / count)


def placed_figures(model: ReferenceModel, places: Tensor, turns: Tensor, floor_height: float) -> Figure:
    """The reference, turned and put with the hip above each place, legs settled to the floor. -> K * H poses.

    `places` [K, 3] surface points [m], `turns` [H] [rad] on top of the reference's own heading.
    """
    root = places + torch.tensor([0.0, model.hip_height, 0.0])
    upright = model.figure.rotations.expand(len(places), -1, -1)
    settled = figure_from_pose(model.skeleton, root, upright)
    soles = model.contacts.joint[model.contacts.on_floor]
    if len(soles):
        ankle = float(model.figure.positions[0, soles, 1].max()) - model.floor_height
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
    figure: Figure, model: ReferenceModel, target: Target, settings: Settings, *, chunk: int = 1024
) -> Candidates:
    """Energies of many poses, in chunks to bound the memory."""
    starts = range(0, len(figure), chunk)
    parts = [total_energy(figure[slice(i, i + chunk)], model, target, settings) for i in starts]
    terms = {name: torch.cat([part[1][name] for part in parts]) for name in parts[0][1]}
    return Candidates(figure, torch.cat([part[0] for part in parts]), terms)


def coarse_search(
    model: ReferenceModel,
    target: Target,
    settings: Settings,
    *,
    places: Tensor,
    turns: Tensor,
    shortlist: int,
    keep: int,
) -> Candidates:
    """The best `keep` distinct rigid placements: `shortlist` of them by geometry, those then by the whole energy."""
    weights = settings.weights
    figure = placed_figures(model, places, turns, target.floor_height)
    # Rigid moves hardly change the terms of the body alone; contacts and penetration imply the clearance.
    cheap = replace(
        settings,
        weights=replace(weights, prior=0.0, angle_limit=0.0, gravity=0.0, self_collision=0.0, floor=0.0, clearance=0.0),
    )
    if weights.contact or weights.penetration:
        candidates = evaluate(figure, model, target, without_descriptor(cheap))
        figure = figure[distinct(candidates, shortlist, reach=0.06, angle=0.3)]
    candidates = evaluate(figure, model, target, settings)
    return candidates.picked(distinct(candidates, keep))
