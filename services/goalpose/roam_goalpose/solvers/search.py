"""The coarse rigid search: every resting place times every heading in one batch, ranked by geometry, then by all."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import torch
from roam_character.rotation import quat_from_yaw, quat_mul, quat_rotate, quat_to_matrix
from torch import Tensor

from roam_goalpose.energy.figure import Figure, figure_concat
from roam_goalpose.energy.objective import Objective, coarse_terms
from roam_goalpose.energy.reference import PerReference, ReferenceModel
from roam_goalpose.energy.scene import Settings, Target
from roam_goalpose.energy.terms.contact import Contacts, contact, contacts_of
from roam_goalpose.energy.terms.facing import Facing, carried_front, facing
from roam_goalpose.energy.weights import EnergyWeights
from roam_goalpose.objects import Shape
from roam_goalpose.references.legs import settle_legs
from roam_goalpose.solvers.candidates import Candidates, candidates_concat, distinct
from roam_goalpose.solvers.progress import Watch

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
    upright = model.figure[torch.arange(count).repeat_interleave(spots)].moved_to(root.flatten(0, 1))
    contacts = contacts_of(model)
    on_floor = contacts.on_floor
    height = model.figure.positions[torch.arange(count)[:, None], contacts.joint, 1] - model.floor_height[:, None]
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
        found = Objective(model.of(reference[now]), target, settings).at(figure[now])
        parts.append(Candidates(figure[now], reference[now], found.energy, found.terms))
    return candidates_concat(parts)


@torch.no_grad()
def best_touching(
    placed: Figure, model: ReferenceModel, target: Target, weights: EnergyWeights, turns: Tensor, count: int
) -> Tensor:
    """Of all places and headings the `count` best of each reference by contact and facing. -> [R, count].

    `placed` has R * K poses as `placed_figures` makes them, every one is looked at with every angle of `turns` [H];
    k * H + h is the index of place k with turn h. Contact costs most and can lower no energy below what facing alone
    makes of it: placements whose facing is already worse than the best found are left out, exactly.
    """
    touch = _Touch.of(placed, model, target, weights, turns)
    energy = torch.full_like(touch.least, torch.inf)
    first = max(count, energy.shape[1] // 4)
    selected = touch.least <= touch.least.kthvalue(first, dim=1, keepdim=True).values
    energy[selected] = touch.energy(selected)
    selected = energy.isinf() & (touch.least < energy.kthvalue(count, dim=1, keepdim=True).values)
    energy[selected] = touch.energy(selected)
    return energy.topk(count, largest=False).indices


@dataclass(frozen=True, eq=False)
class _Touch:
    """Contact and facing of R references at K places, turned by H angles: without a figure for each."""

    contacts: Contacts  # of the R references
    target: Target
    weight: float  # of contact
    root: Tensor  # [R * K, 3] [m]
    arms: Tensor  # [R * K, contacts, 3] from the root to the contacts, not turned yet
    turn: Tensor  # [H, 3, 3]
    least: Tensor  # [R, K * H] what facing makes of the energy when all contacts are met

    @classmethod
    def of(
        cls, placed: Figure, model: ReferenceModel, target: Target, weights: EnergyWeights, turns: Tensor
    ) -> "_Touch":
        own = model[torch.arange(len(model)).repeat_interleave(len(placed) // len(model))]
        turn, carried = quat_to_matrix(quat_from_yaw(turns)), own.prepared[Facing.name]
        assert isinstance(carried, PerReference)
        front = carried_front(placed, carried) @ turn[:, None].transpose(-1, -2)  # [H, R * K, 1, 3]
        aside = facing(front.transpose(0, 1).flatten(0, 1), target.front).energy
        contacts, weight = contacts_of(model), weights["contact"]
        missing = 1.0 - contacts.weight.sum(-1, keepdim=True)
        least = weights["facing"] * aside.reshape(len(model), -1) + weight * missing
        arms = contacts_of(own).on(placed) - placed.root_position[:, None]
        return cls(contacts, target, weight, placed.root_position, arms, turn, least)

    def energy(self, selected: Tensor) -> Tensor:
        """Of the `selected` [R, K * H] placements, in their order."""
        reference, which = torch.nonzero(selected, as_tuple=True)
        pose = reference * (len(self.root) // len(selected)) + which // len(self.turn)
        contacts = self.contacts[reference]
        points = self.root[pose, None] + self.arms[pose] @ self.turn[which % len(self.turn)].transpose(-1, -2)
        misses = contacts.misses(points[..., 1] - self.target.floor_height, self.target.distance.query(points))
        met = contact(misses, contacts.weight).energy - (1.0 - contacts.weight.sum(-1))
        return self.least[selected] + self.weight * met


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
    if w["contact"]:
        best = best_touching(placed, model, target, w, turns, min(TOUCHING, each))
        which = (best + each * torch.arange(len(model))[:, None]).flatten()
    watch.check()
    figure = turned_figures(placed[which // len(turns)], turns[which % len(turns)])
    reference = owner[which // len(turns)]
    if w["contact"] or w["penetration"]:
        # Rigid moves hardly change the terms of the body alone; contacts and penetration imply the clearance.
        cheap = replace(settings, weights=w.only(*coarse_terms()))
        found = evaluate(figure, reference, model, target, cheap)
        chosen = distinct(found, shortlist * len(model), reach=apart, angle=0.3, each=shortlist)
        figure, reference = figure[chosen], reference[chosen]
    watch.check()
    return evaluate(figure, reference, model, target, settings)


STEP = 0.02  # [m] vertical sampling
HEADROOM = (0.08, 0.16, 0.24, 0.32)  # [m] above a surface, free of the object
LOWEST, HIGHEST = 0.12, 1.15  # [m] above the floor: nobody sits on less or more


def find_places(shape: Shape, *, most: int = 160) -> Tensor:
    """Surface points [K, 3] [m] to try the seat of the body on, at most about `most`, on a horizontal grid."""
    low, high = shape.bounds
    spacing = float(np.clip(np.sqrt((high[0] - low[0]) * (high[2] - low[2]) / most), 0.045, 0.12))
    columns = _columns(low, high, spacing)
    top = min(float(high[1]), shape.floor_height + HIGHEST) + STEP
    heights = torch.arange(top, shape.floor_height + LOWEST, -STEP)
    points = torch.stack(torch.broadcast_tensors(columns[:, None, 0], heights, columns[:, None, 1]), dim=-1)
    d = shape.distance.query(points)  # [columns, heights], downwards
    enter = (d[:, :-1] > 0) & (d[:, 1:] <= 0)
    column, step = torch.nonzero(enter, as_tuple=True)
    before, after = d[column, step], d[column, step + 1]
    surface = points[column, step].clone()
    surface[:, 1] -= STEP * before / (before - after).clamp(min=1e-6)
    above = surface[:, None] + torch.tensor([[0.0, h, 0.0] for h in HEADROOM])
    return surface[(shape.distance.query(above) > 0.02).all(-1)]


def _columns(low: npt.NDArray[np.float64], high: npt.NDArray[np.float64], spacing: float) -> Tensor:
    """Grid over the footprint, symmetric about its middle. -> [K, 2]."""
    axes = []
    for axis in (0, 2):
        count = max(1, int((high[axis] - low[axis]) / spacing))
        middle = (high[axis] + low[axis]) / 2
        axes.append(middle + spacing * (torch.arange(count) - (count - 1) / 2))
    x, z = torch.meshgrid(axes[0].float(), axes[1].float(), indexing="ij")
    return torch.stack([x.reshape(-1), z.reshape(-1)], dim=-1)
