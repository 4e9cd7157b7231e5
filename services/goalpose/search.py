"""The coarse rigid search: every resting place times every heading in one batch, ranked by geometry, then by all."""

import math
from dataclasses import replace

import torch
from character.rotation import quat_from_yaw, quat_mul, quat_rotate
from torch import Tensor

from goalpose.candidates import Candidates, candidates_concat, distinct
from goalpose.energy.contact import contact
from goalpose.energy.facing import carried_front, facing
from goalpose.energy.figure import Figure, figure_concat, figure_from_pose
from goalpose.energy.total import ReferenceModel, Settings, Target, total_energy, without_descriptor
from goalpose.energy.weights import EnergyWeights
from goalpose.legs import settle_legs
from goalpose.progress import Watch

TOUCHING = 160  # placements of each reference that are looked at more closely, the best by contact


def headings(count: int, first: float) -> Tensor:
    """`count` evenly spaced turns about +Y [rad], beginning with `first`."""
    return first + torch.arange(count) * (2 * math.pi / count)


def placed_figures(model: ReferenceModel, places: Tensor, floor_height: float) -> Figure:
    """Every reference with the hip above every place, legs settled to the floor. -> R * K poses.

    `places` [K, 3] surface points [m].
    """
    count, spots = len(model), len(places)
    root = places + torch.tensor([0.0, 1.0, 0.0]) * model.hip_height[:, None, None]
    rotations = model.figure.rotations[:, None].expand(-1, spots, -1, -1)
    upright = figure_from_pose(model.skeleton, root.flatten(0, 1), rotations.flatten(0, 1))
    on_floor = model.contacts.on_floor
    height = model.figure.positions[torch.arange(count)[:, None], model.contacts.joint, 1] - model.floor_height[:, None]
    ankle = torch.where(on_floor, height, -torch.inf).amax(1)
    stands = on_floor.any(1).repeat_interleave(spots)
    if not stands.any():
        return upright
    settled = settle_legs(upright[stands], floor_height, ankle_height=ankle.repeat_interleave(spots)[stands])
    figures = figure_concat([settled, upright[~stands]])
    return figures[torch.argsort(torch.argsort(~stands, stable=True))]


def turned_figures(figure: Figure, turns: Tensor) -> Figure:
    """Every pose [B] turned about its own root by its own angle [B] [rad]."""
    turn = quat_from_yaw(turns)[:, None]  # [B, 1, 4]
    root = figure.root_position[:, None]
    positions = root + quat_rotate(turn, figure.positions - root)
    orientations = quat_mul(turn, figure.orientations)
    rotations = torch.cat([orientations[:, :1], figure.rotations[:, 1:]], dim=1)
    return Figure(figure.skeleton, figure.root_position, rotations, positions, orientations)


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


@torch.no_grad()
def touch_energy(
    figure: Figure, model: ReferenceModel, target: Target, weights: EnergyWeights, turns: Tensor
) -> Tensor:
    """Contact and facing of every pose [B] turned by every angle [H]: without a figure for each. -> [B, H]."""
    root = figure.root_position[:, None, None]
    arms = (model.contacts.on(figure)[:, None] - root).expand(-1, len(turns), -1, -1)
    turn = quat_from_yaw(turns)[None, :, None]
    points = root + quat_rotate(turn, arms)  # [B, H, K, 3]
    distance = target.distance.query(points).flatten(0, 1)
    every = torch.arange(len(figure)).repeat_interleave(len(turns))
    contacts = model.contacts[every] if len(model) > 1 else model.contacts
    misses = contacts.misses(points[..., 1].flatten(0, 1) - target.floor_height, distance)
    energy = weights.contact * contact(misses, contacts.weight).energy
    front = quat_rotate(turn, carried_front(figure, model.front)[:, None]).flatten(0, 1)
    return (energy + weights.facing * facing(front, target.front).energy).reshape(len(figure), len(turns))


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
    w = settings.weights
    watch.check()
    placed = placed_figures(model, places, target.floor_height)
    owner = torch.arange(len(model)).repeat_interleave(len(places))
    each = len(places) * len(turns)
    which = torch.arange(len(model) * each)
    if w.contact:
        rough = touch_energy(placed, model[owner], target, w, turns).reshape(len(model), each)
        best = rough.topk(min(TOUCHING, each), largest=False).indices
        which = (best + each * torch.arange(len(model))[:, None]).flatten()
    watch.check()
    figure = turned_figures(placed[which // len(turns)], turns[which % len(turns)])
    reference = owner[which // len(turns)]
    if w.contact or w.penetration:
        # Rigid moves hardly change the terms of the body alone; contacts and penetration imply the clearance.
        cheap = replace(w, prior=0.0, angle_limit=0.0, gravity=0.0, self_collision=0.0, floor=0.0, clearance=0.0)
        found = evaluate(figure, reference, model, target, without_descriptor(replace(settings, weights=cheap)))
        chosen = distinct(found, shortlist * len(model), reach=apart, angle=0.3, each=shortlist)
        figure, reference = figure[chosen], reference[chosen]
    watch.check()
    return evaluate(figure, reference, model, target, settings)
