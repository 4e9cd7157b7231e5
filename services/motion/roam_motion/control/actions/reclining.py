"""Lying down, planned: from a seat on the furniture's edge to the lying pose, and back the same way.

There is one captured recline, and it is on the floor: a network learns from that where it should be in the end, not how
legs come over an edge. So it walks up and sits down on the edge, which it does well, and what follows is worked out
once per goal: hips turn and scoot, legs are lifted over whatever is in their way, the trunk reclines. Every bone's and
joint's speed is bounded, and the ends are eased. Getting up plays the same poses backwards.

Lengths are for legs of 0.82 m (see proportions.py); numbers without a source were tuned by hand on the lying approaches
of `roam evaluate motion`.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from roam_character.kinematics import bent_joint
from roam_character.matrices import matrix_from_6d, matrix_from_rotvec, matrix_to_6d, unit
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.actions import SIT
from roam_motion.animation.collision import Furniture, furniture_of, goal_depths, keep_clear
from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.control.seat import Seat, Transition

_SAMPLES = 44  # poses that are planned, before they are timed
_FASTEST = 0.034, 0.10  # [m], [rad] a joint moves, a bone turns per frame at most
_EASE = 22  # frames from rest to full speed, and back
_HIPS_BACK = 0.33  # [m] seated hips behind the ankles
_BESIDE = 0.09  # [m] ankles beside the middle
_ANKLE = 0.085  # [m] height of a flat foot's ankle
_TUCKED = 0.46, 0.06  # [m] ankles ahead of and above the hips while the legs come round
_UPRIGHT, _LEANT = -0.12, -0.60  # [rad] pitch of the hips on the edge, and while the legs are lifted
_SEAT = 0.085  # [m] kept between seated hips and the furniture: a cushion gives way
_LEAD = 0.05  # by which the leg that is nearer to the foot end goes first
_SKIN = 0.012  # [m] kept between legs and furniture
_ROUNDS = 6, 2  # of lifting legs, of clearing arms
_SOFTNESS = 2  # samples over which lifts and turns are smoothed
_ARM = (-0.45, -1.30), -0.95  # [rad] upper arm forward and down, elbow bent: hands over the thighs
_LIES = 0.4  # share of the way from which one lies: the hips have left the edge
_FOLDED = 0.15  # [m] from hip to ankle at the least, besides the bones' difference
_STRAIGHT = 0.998  # share of a leg's length from hip to ankle at the most
_STOOP = {"spine": 0.10, "chest": 0.08, "neck": 0.06}  # [rad] forward


@dataclass(frozen=True, eq=False)
class _Place:
    """Where one lies and sits, in the world."""

    hips: Tensor  # [2, 3] seated, lying [m]
    aside: Tensor  # [3] horizontal, out of the furniture
    along: Tensor  # [3] horizontal, from head to feet
    sense: float  # 1 when turning from `aside` to `along` is a turn to the left, else -1
    furniture: Furniture | None


@lru_cache(maxsize=128)
def reclining_of(figure: Figure, seat: Seat) -> Transition:
    """The way from the edge into a lying `seat`."""
    place = _place(figure, seat)
    share = torch.linspace(0, 1, _SAMPLES)
    hips = _hips(place, share)
    orientations = _orientations(figure, seat, place, hips, share)
    orientations = _cleared(figure, seat, place, hips, orientations)
    hips, orientations = _timed(figure, hips, orientations)
    lying = torch.from_numpy(seat.orientations)
    hips, orientations = torch.cat([hips, place.hips[1:]]), torch.cat([orientations, lying[None]])
    positions = figure.positions(hips, orientations)
    frame = figure.frame(positions)
    roots = torch.cat([frame.origin, frame.direction], 1).numpy()
    edge = _edge(figure, seat, positions[0].numpy(), orientations[0].numpy(), roots[0])
    return Transition(edge, seat, positions.numpy(), orientations.numpy(), roots, _LIES)


def _edge(figure: Figure, seat: Seat, positions: np.ndarray, orientations: np.ndarray, root: np.ndarray) -> Seat:
    """The seated pose, before which one stands where one stands before lying down."""
    depths = None
    if seat.volume is not None and seat.depths is not None:
        depths = np.maximum(goal_depths(figure, positions, orientations, seat.volume), seat.depths)
    return Seat(SIT.name, positions, orientations, root, seat.stand, seat.volume, depths)


def _place(figure: Figure, seat: Seat) -> _Place:
    aside, along = (torch.tensor([float(v[0]), 0.0, float(v[1])]) for v in (seat.stand[2:], seat.root[2:]))
    lying = torch.from_numpy(seat.positions[0])
    out = float((seat.stand[:2] - seat.root[:2]) @ seat.stand[2:])
    ahead = max(out - (0.05 + _HIPS_BACK) * size(figure), 0.0)
    seated = torch.tensor([float(seat.root[0]), 0.0, float(seat.root[1])]) + ahead * aside
    furniture = None
    if seat.volume is not None and seat.depths is not None:
        furniture = furniture_of([seat.volume], [seat.depths], [False])
    seated[1] = lying[1] if furniture is None else _seat_height(furniture, seated, float(lying[1]))
    sense = 1.0 if float(torch.linalg.cross(aside, along)[1]) > 0 else -1.0
    return _Place(torch.stack([seated, lying]), aside, along, sense, furniture)


def _seat_height(furniture: Furniture, place: Tensor, lying: float) -> Tensor:
    """Height of hips that sit at a place [3] [m]: the lowest that is clear from there on, near the `lying` hips'."""
    heights = lying + torch.arange(-0.12, 0.25, 0.005)
    points = place.expand(len(heights), 3).clone()
    points[:, 1] = heights
    gap, _ = furniture.distance(points[None])
    blocked = (gap[0] < _SEAT).nonzero()[:, 0]
    return heights[min(int(blocked.max()) + 1, len(heights) - 1)] if len(blocked) else heights[0]


def _eased(share: Tensor, begin: float, end: float) -> Tensor:
    """0 before `begin`, 1 after `end`, smooth between. [N] -> [N]."""
    t = ((share - begin) / (end - begin)).clamp(0.0, 1.0)
    return t * t * t * (t * (6 * t - 15) + 10)


def _hips(place: _Place, share: Tensor) -> Tensor:
    """Places of the hips [N, 3] [m], over whatever lies between."""
    moved = _eased(share, 0.12, 0.72)[:, None]
    hips = torch.lerp(place.hips[:1], place.hips[1:], moved)
    if place.furniture is None:
        return hips
    gap = place.furniture.distance(hips[None])[0][0]
    least = torch.lerp(gap[:1], gap[-1:], moved[:, 0]).clamp_max(_SEAT)
    return hips + _raised((least - gap).clamp_min(0.0))[:, None] * torch.tensor([0.0, 1.0, 0.0])


def _raised(lift: Tensor) -> Tensor:
    """A smooth curve over a `lift` [N, …] that ends in it at both ends."""
    wide = torch.nn.functional.max_pool1d(lift.reshape(len(lift), -1).T, 2 * _SOFTNESS + 1, 1, _SOFTNESS).T
    soft = _smoothed(wide).reshape(lift.shape)
    ends = torch.minimum(torch.arange(len(lift)), torch.arange(len(lift)).flip(0)) / (2 * _SOFTNESS)
    ends = ends.clamp_max(1.0).reshape(-1, *[1] * (lift.ndim - 1))
    return torch.lerp(lift, torch.maximum(soft, lift), ends)


def _smoothed(rows: Tensor) -> Tensor:
    """Rows [N, K] averaged with their neighbours; the ends stay."""
    for _ in range(_SOFTNESS):
        around = torch.cat([rows[:1], rows, rows[-1:]])
        middle = 0.25 * around[:-2] + 0.5 * around[1:-1] + 0.25 * around[2:]
        rows = torch.cat([rows[:1], middle[1:-1], rows[-1:]])
    return rows


def _orientations(figure: Figure, seat: Seat, place: _Place, hips: Tensor, share: Tensor) -> Tensor:
    """World orientations [N, J, 3, 3] of all bones."""
    lying = torch.from_numpy(seat.orientations)
    angle = math.atan2(float(place.aside[0]), float(place.aside[2])) + place.sense * (math.pi / 2) * _eased(
        share, 0.04, 0.62
    )
    yaw = matrix_from_rotvec(angle[:, None] * torch.tensor([0.0, 1.0, 0.0]))
    pitch = torch.lerp(torch.tensor(_UPRIGHT), torch.tensor(_LEANT), _eased(share, 0.0, 0.4))
    pelvis = _between(
        yaw @ matrix_from_rotvec(pitch[:, None] * torch.tensor([1.0, 0.0, 0.0])),
        lying[None, 0],
        _eased(share, 0.45, 1.0),
    )
    local = _between(_seated_rotations(figure)[None], figure.local(lying)[None], _eased(share, 0.3, 1.0)[:, None])
    local[:, 0] = pelvis
    world = figure.world(local)
    return _legs_bent(figure, seat, place, hips, world, yaw, share)


def _between(start: Tensor, end: Tensor, share: Tensor) -> Tensor:
    """Rotations [..., 3, 3] that share of the way from one to another."""
    return matrix_from_6d(torch.lerp(matrix_to_6d(start), matrix_to_6d(end), share[..., None]))


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


def _legs_bent(
    figure: Figure, seat: Seat, place: _Place, hips: Tensor, world: Tensor, yaw: Tensor, share: Tensor
) -> Tensor:
    """Orientations with legs whose feet leave the floor, come round over the edge and stretch out."""
    thigh, _, foot, toes = figure.legs.T
    starts = figure.positions(hips, world)[:, thigh]
    ankles = _ankles(figure, seat, place, hips, yaw, share)
    bend = unit(0.6 * yaw[:, :, 2] + torch.tensor([0.0, 0.8, 0.0]))[:, None].expand_as(ankles)
    ankles = _lifted(figure, place, starts, ankles, bend)
    upper, lower = _leg_bones(figure, starts, ankles, bend)
    settled = _eased(share, 0.7, 1.0)[:, None]
    lying = torch.from_numpy(seat.orientations)
    bent = world.clone()
    for column, bones in enumerate((upper, lower)):
        joint = figure.legs[:, column]
        bent[:, joint] = _between(bones, lying[joint][None], settled)
    flat = (yaw[:, None] @ torch.eye(3)).expand(-1, 2, -1, -1)
    bent[:, foot] = _between(
        _between(flat, bent[:, figure.legs[:, 1]], _eased(share, 0.02, 0.3)[:, None]), lying[foot][None], settled
    )
    bent[:, toes] = _between(bent[:, foot], lying[toes][None], settled)
    return bent


def _ankles(figure: Figure, seat: Seat, place: _Place, hips: Tensor, yaw: Tensor, share: Tensor) -> Tensor:
    """Where the ankles would be if nothing were in their way [N, 2, 3] [m]: left, right."""
    foot = figure.legs[:, 2]
    beside, ankle, back, ahead, above = (size(figure) * length for length in (_BESIDE, _ANKLE, _HIPS_BACK, *_TUCKED))
    sides = torch.tensor([beside, -beside])
    floor = torch.stack([sides, torch.full((2,), ankle) - place.hips[0, 1], torch.full((2,), back)], 1)
    tucked = torch.stack([sides, torch.full((2,), above), torch.full((2,), ahead)], 1)
    end = torch.from_numpy(seat.positions[foot] - seat.positions[0])
    lead = share[:, None] + _LEAD * place.sense * torch.tensor([1.0, -1.0]) * torch.sin(math.pi * share)[:, None]
    relative = torch.lerp(floor, tucked, _eased(lead, 0.0, 0.42)[..., None])
    turned = (yaw[:, None] @ relative[..., None])[..., 0]
    return hips[:, None] + torch.lerp(turned, end.expand_as(turned), _eased(lead, 0.58, 1.0)[..., None])


def _knees(figure: Figure, starts: Tensor, ankles: Tensor, bend: Tensor) -> tuple[Tensor, Tensor]:
    """Knees and ankles [N, 2, 3] that legs from `starts` have, bent towards `bend`, never straight."""
    upper, lower = figure.lengths[figure.legs[:, 1], None], figure.lengths[figure.legs[:, 2], None]
    way = ankles - starts
    reach = vector_norm(way, dim=-1, keepdim=True).clamp_min(1e-6)
    least, most = (upper - lower).abs() + _FOLDED, _STRAIGHT * (upper + lower)
    ends = starts + way * (reach.maximum(least).minimum(most) / reach)
    return bent_joint(starts, ends, (upper, lower), bend, straightest=_STRAIGHT), ends


def _leg_bones(figure: Figure, starts: Tensor, ankles: Tensor, bend: Tensor) -> tuple[Tensor, Tensor]:
    """World orientations of thighs and shins [N, 2, 3, 3]."""
    knees, ends = _knees(figure, starts, ankles, bend)
    hinge = unit(torch.linalg.cross(bend, ends - starts, dim=-1))
    upper = _along(hinge, knees - starts) @ _along(_LEFT.expand(2, 3), figure.offsets[figure.legs[:, 1]]).mT
    lower = _along(hinge, ends - knees) @ _along(_LEFT.expand(2, 3), figure.offsets[figure.legs[:, 2]]).mT
    return upper, lower


_LEFT = torch.tensor([1.0, 0.0, 0.0])


def _along(hinge: Tensor, bone: Tensor) -> Tensor:
    """The frame [..., 3, 3] whose -Y runs along a bone and whose +X is as near to its hinge as can be."""
    up = -unit(bone)
    left = unit(hinge - (hinge * up).sum(-1, keepdim=True) * up)
    return torch.stack([left, up, torch.linalg.cross(left, up, dim=-1)], -1)


def _lifted(figure: Figure, place: _Place, starts: Tensor, ankles: Tensor, bend: Tensor) -> Tensor:
    """Ankles [N, 2, 3] raised until shins and feet are over what is in their way."""
    if place.furniture is None:
        return ankles
    up, lift = torch.tensor([0.0, 1.0, 0.0]), torch.zeros(ankles.shape[:2])
    first: Tensor | None = None
    for _ in range(_ROUNDS[0]):
        knees, ends = _knees(figure, starts, ankles + lift[..., None] * up, bend)
        ahead = ends + 0.12 * unit(bend * torch.tensor([1.0, 0.0, 1.0]))
        points = torch.stack([torch.lerp(knees, ends, 0.4), torch.lerp(knees, ends, 0.7), ends, ahead], 2)
        gap = place.furniture.distance(points.flatten(0, 2)[None])[0].reshape(points.shape[:3])
        depth = torch.tensor([0.05, 0.05, 0.05, 0.045]) + _SKIN - gap
        first = depth if first is None else first
        # What the ends themselves press into the furniture stays so.
        ends_press = torch.lerp(first[:1], first[-1:], torch.linspace(0, 1, len(depth))[:, None, None])
        lift = lift + (depth - ends_press.clamp_min(0.0)).amax(-1).clamp_min(0.0)
    return ankles + _raised(lift)[..., None] * up


def _cleared(figure: Figure, seat: Seat, place: _Place, hips: Tensor, orientations: Tensor) -> Tensor:
    """Orientations with trunk and arms out of the furniture, smooth from one sample to the next; the last stays."""
    if seat.volume is not None and seat.depths is not None:
        count = len(hips)
        furniture = furniture_of([seat.volume] * count, [seat.depths] * count, [False] * count)
        for _ in range(_ROUNDS[1]):
            _, orientations, _ = keep_clear(
                figure, furniture, figure.positions(hips, orientations), orientations, torch.zeros(count)
            )
    flat = matrix_to_6d(orientations).flatten(1)
    flat = torch.cat([flat[:-1], matrix_to_6d(torch.from_numpy(seat.orientations)).flatten()[None]])
    return matrix_from_6d(_smoothed(flat).unflatten(1, (-1, 6)))


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
