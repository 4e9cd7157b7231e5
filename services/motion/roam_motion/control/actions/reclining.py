"""Lying down and getting up, planned: from a seat on the furniture's edge to the lying pose, and from there back to it.

There is one captured recline, and it is on the floor: a network learns from that where it should be in the end, not how
legs come over an edge. So it walks up and sits down on the edge, which it does well, and what follows is worked out
once per goal and way: a hand goes down on the furniture, the legs come up one after the other, hips turn and scoot, the
trunk reclines. Every bone's and joint's speed is bounded, and the ends are eased. There are several ways (ways.py);
who lies down one way gets up another.

Lengths are for legs of 0.82 m (see proportions.py); numbers without a source were tuned by hand on the lying approaches
of `roam evaluate motion`.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import torch
from roam_character.matrices import matrix_from_6d, matrix_from_rotvec, matrix_to_6d
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.actions import SIT
from roam_motion.animation.collision import furniture_of, goal_depths, keep_clear
from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.control.actions.reclining_limbs import (
    HIPS_BACK,
    between,
    hands_down,
    height_over,
    legs_bent,
    raised,
    smoothed,
)
from roam_motion.control.actions.ways import WAYS, Bed, Way, eased
from roam_motion.control.seat import Seat, Transition

_SAMPLES = 44  # poses that are planned, before they are timed
_FASTEST = 0.040, 0.13  # [m], [rad] a joint moves, a bone turns per frame at most
_EASE = 18  # frames from rest to full speed, and back
_UPRIGHT = -0.12  # [rad] pitch of the hips on the edge
_SEAT = 0.085  # [m] kept between seated hips and the furniture: a cushion gives way
_ROUNDS = 2  # of clearing trunk and arms
_ARM = (-0.45, -1.30), -0.95  # [rad] upper arm forward and down, elbow bent: hands over the thighs
_CALVES = 0.16  # [m] standing place in front of the furniture's edge (see lie.py)
_LIES = 0.4  # share of the way from which one lies: the hips have left the edge
_STOOP = {"spine": 0.10, "chest": 0.08, "neck": 0.06}  # [rad] forward


@lru_cache(maxsize=128)
def reclining_of(figure: Figure, seat: Seat, number: int = 0) -> Transition:
    """The way from the edge into a lying `seat`, the `number`-th of `WAYS`, and the next one of them back."""
    place = _place(figure, seat)
    down = _planned(figure, seat, place, WAYS[number])
    up = _planned(figure, seat, place, WAYS[(number + 1) % len(WAYS)])
    lying = torch.from_numpy(seat.orientations)[None]
    hips = torch.cat([down[0], place.hips[1:], up[0].flip(0)])
    orientations = torch.cat([down[1], lying, up[1].flip(0)])
    positions = figure.positions(hips, orientations)
    frame = figure.frame(positions)
    roots = torch.cat([frame.origin, frame.direction], 1).numpy()
    edge = _edge(figure, seat, positions[0].numpy(), orientations[0].numpy(), roots[0])
    return Transition(edge, seat, positions.numpy(), orientations.numpy(), roots, len(down[0]), _LIES)


def way_of(manner: Sequence[float]) -> int:
    """Which of `WAYS` somebody of a manner lies down by: each by about as many."""
    spread = sum(manner) / math.sqrt(max(len(manner), 1))
    return min(int(len(WAYS) * 0.5 * (1 + math.erf(spread / math.sqrt(2)))), len(WAYS) - 1)


def _planned(figure: Figure, seat: Seat, place: Bed, way: Way) -> tuple[Tensor, Tensor]:
    """Hips [N, 3] and orientations [N, J, 3, 3] at 30 Hz from the edge to just before the lying pose."""
    share = torch.linspace(0, 1, _SAMPLES)
    hips = _hips(place, way, share)
    orientations = _orientations(figure, seat, place, way, hips, share)
    return _timed(figure, hips, _cleared(figure, seat, hips, orientations))


def _edge(figure: Figure, seat: Seat, positions: np.ndarray, orientations: np.ndarray, root: np.ndarray) -> Seat:
    """The seated pose, before which one stands where one stands before lying down."""
    depths = None
    if seat.volume is not None and seat.depths is not None:
        depths = np.maximum(goal_depths(figure, positions, orientations, seat.volume), seat.depths)
    return Seat(SIT.name, positions, orientations, root, seat.stand, seat.volume, depths)


def _place(figure: Figure, seat: Seat) -> Bed:
    aside, along = (torch.tensor([float(v[0]), 0.0, float(v[1])]) for v in (seat.stand[2:], seat.root[2:]))
    lying = torch.from_numpy(seat.positions[0])
    out = float((seat.stand[:2] - seat.root[:2]) @ seat.stand[2:])
    ahead = max(out - (0.05 + HIPS_BACK) * size(figure), 0.0)
    seated = torch.tensor([float(seat.root[0]), 0.0, float(seat.root[1])]) + ahead * aside
    furniture = None
    if seat.volume is not None and seat.depths is not None:
        furniture = furniture_of([seat.volume], [seat.depths], [False])
    seated[1] = lying[1] if furniture is None else height_over(furniture, seated, float(lying[1]), _SEAT)
    sense = 1.0 if float(torch.linalg.cross(aside, along)[1]) > 0 else -1.0
    return Bed(torch.stack([seated, lying]), aside, along, sense, max(out - _CALVES * size(figure), 0.0), furniture)


def _hips(place: Bed, way: Way, share: Tensor) -> Tensor:
    """Places of the hips [N, 3] [m], over whatever lies between."""
    moved = eased(share, way.scoots)[:, None]
    hips = torch.lerp(place.hips[:1], place.hips[1:], moved)
    if place.furniture is None:
        return hips
    gap = place.furniture.distance(hips[None])[0][0]
    least = torch.lerp(gap[:1], gap[-1:], moved[:, 0]).clamp_max(_SEAT)
    return hips + raised((least - gap).clamp_min(0.0))[:, None] * torch.tensor([0.0, 1.0, 0.0])


def _orientations(figure: Figure, seat: Seat, place: Bed, way: Way, hips: Tensor, share: Tensor) -> Tensor:
    """World orientations [N, J, 3, 3] of all bones."""
    lying = torch.from_numpy(seat.orientations)
    turned = eased(share, way.turns)
    angle = math.atan2(float(place.aside[0]), float(place.aside[2])) + place.sense * (math.pi / 2) * turned
    yaw = matrix_from_rotvec(angle[:, None] * torch.tensor([0.0, 1.0, 0.0]))
    pitch = torch.lerp(torch.tensor(_UPRIGHT), torch.tensor(way.back), eased(share, way.leans))
    roll = place.sense * way.sideways * eased(share, way.leans) * (1 - turned)
    tilt = matrix_from_rotvec(roll[:, None] * torch.tensor([0.0, 0.0, 1.0]))
    upright = yaw @ tilt @ matrix_from_rotvec(pitch[:, None] * torch.tensor([1.0, 0.0, 0.0]))
    pelvis = between(upright, lying[None, 0], eased(share, way.reclines))
    loosens = eased(share, (max(way.reclines[0] - 0.15, 0.0), way.reclines[1]))[:, None]
    local = between(_seated_rotations(figure)[None], figure.local(lying)[None], loosens)
    local[:, 0] = pelvis
    world = legs_bent(figure, seat, place, way, hips, figure.world(local), yaw, share)
    return hands_down(figure, place, way, hips, world, yaw, share)


def _seated_rotations(figure: Figure) -> Tensor:
    """Local rotations [J, 3, 3] of someone who sits upright with the hands over the thighs."""
    turns, names = torch.zeros(figure.joint_count, 3), figure.skeleton
    for name, angle in _STOOP.items():
        turns[names.index(name), 0] = angle
    rotations = matrix_from_rotvec(turns)
    (forward, down), bent = _ARM
    for side, sign in (("left", 1.0), ("right", -1.0)):
        swing = matrix_from_rotvec(torch.tensor([forward, 0.0, 0.0])) @ matrix_from_rotvec(
            torch.tensor([0.0, 0.0, sign * down])
        )
        rotations[names.index(f"{side}UpperArm")] = swing
        rotations[names.index(f"{side}LowerArm")] = matrix_from_rotvec(torch.tensor([0.0, sign * bent, 0.0]))
    return rotations


def _cleared(figure: Figure, seat: Seat, hips: Tensor, orientations: Tensor) -> Tensor:
    """Orientations with trunk and arms out of the furniture, smooth from one sample to the next; the last stays."""
    if seat.volume is not None and seat.depths is not None:
        count = len(hips)
        furniture = furniture_of([seat.volume] * count, [seat.depths] * count, [False] * count)
        for _ in range(_ROUNDS):
            _, orientations, _ = keep_clear(
                figure, furniture, figure.positions(hips, orientations), orientations, torch.zeros(count)
            )
    flat = matrix_to_6d(orientations).flatten(1)
    flat = torch.cat([flat[:-1], matrix_to_6d(torch.from_numpy(seat.orientations)).flatten()[None]])
    return matrix_from_6d(smoothed(flat).unflatten(1, (-1, 6)))


def _timed(figure: Figure, hips: Tensor, orientations: Tensor) -> tuple[Tensor, Tensor]:
    """The poses at 30 Hz: as fast as joints may move and bones may turn, from rest to rest, the last left out."""
    positions = figure.positions(hips, orientations)
    ways = vector_norm(positions.diff(dim=0), dim=-1).amax(-1) / _FASTEST[0]
    cosine = ((orientations[1:] * orientations[:-1]).sum((-1, -2)) - 1) / 2
    turns = torch.acos(cosine.clamp(-1.0, 1.0)).amax(-1) / _FASTEST[1]
    needed = torch.cat([torch.zeros(1), torch.maximum(ways, turns).cumsum(0)])
    total = float(needed[-1])
    frames = math.ceil(total) + _EASE
    speed = (torch.minimum(torch.arange(frames) + 0.5, frames - torch.arange(frames) - 0.5) / _EASE).clamp_max(1.0)
    speed = speed * speed * (3 - 2 * speed)
    reached = torch.cat([torch.zeros(1), speed.cumsum(0)])[:-1] * (total / float(speed.sum()))
    after = torch.searchsorted(needed, reached, right=True).clamp(1, len(needed) - 1)
    before = after - 1
    share = ((reached - needed[before]) / (needed[after] - needed[before]).clamp_min(1e-6)).clamp(0.0, 1.0)
    axes = torch.lerp(matrix_to_6d(orientations[before]), matrix_to_6d(orientations[after]), share[:, None, None])
    return torch.lerp(hips[before], hips[after], share[:, None]), matrix_from_6d(axes)
