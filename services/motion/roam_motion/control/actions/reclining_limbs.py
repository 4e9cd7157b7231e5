"""Legs and arms of somebody who lies down: feet come off the floor and over the edge, hands hold the trunk up.

Lengths are for legs of 0.82 m (see proportions.py), tuned on films and on lying approaches (`roam evaluate motion`).
"""

import torch
from roam_character.kinematics import bent_joint
from roam_character.matrices import matrix_between, matrix_from_6d, matrix_to_6d, unit
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.animation.collision import Furniture, limbs_of
from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.control.actions.ways import Bed, Span, Way, eased
from roam_motion.control.seat import Seat

HIPS_BACK = 0.33  # [m] seated hips behind the ankles
_BESIDE = 0.09  # [m] ankles beside the middle
_ANKLE = 0.085  # [m] height of a flat foot's ankle
_TUCKED = 0.46, -0.03  # [m] ankles ahead of and above the hips while the legs come round
_LATER = 0.05  # by which the second leg stretches later
_SKIN = 0.012  # [m] kept between legs and furniture
_ROUNDS = 6  # of lifting legs
_SOFTNESS = 2  # samples over which lifts and turns are smoothed
_HAND = 0.30, 0.27  # [m] a hand that is put down, from the hips towards the head end, and beside the lying trunk
_WRIST = 0.055  # [m] over the furniture
_WITHIN = 0.06  # [m] of the furniture's edge
# [m] a hand is not put down higher than this over the lying hips, nor where the furniture is nearer than the last to
# its arm: at these heights over it, and with the elbow so far out.
_HIGHEST, _ABOVE, _OUT, _ROOM = 0.06, (0.12, 0.26, 0.40), (0.0, 0.16), 0.09
_SWING = 0.30, 0.35  # [m] out and down from the shoulder, what a hand swings round by on its way down
_LONGEST = 0.985  # share of an arm's length that a hand is put down at most
_FOLDED, _STRAIGHT = (
    0.15,
    0.998,
)  # [m] hip to ankle at the least, besides the bones' difference; share of the leg at most
_FOLDED_ARM = 0.08  # [m] the same of shoulder and wrist


def height_over(furniture: Furniture, place: Tensor, near: float, gap: float) -> Tensor:
    """The lowest height at a place [3] [m], near a height, from which on all is `gap` [m] clear of the furniture."""
    heights = near + torch.arange(-0.20, 0.25, 0.005)
    points = place.expand(len(heights), 3).clone()
    points[:, 1] = heights
    distance, _ = furniture.distance(points[None])
    blocked = (distance[0] < gap).nonzero()[:, 0]
    return heights[min(int(blocked.max()) + 1, len(heights) - 1)] if len(blocked) else heights[0]


def between(start: Tensor, end: Tensor, share: Tensor) -> Tensor:
    """Rotations [..., 3, 3] that share of the way from one to another."""
    return matrix_from_6d(torch.lerp(matrix_to_6d(start), matrix_to_6d(end), share[..., None]))


def raised(lift: Tensor) -> Tensor:
    """A smooth curve over a `lift` [N, …] that ends in it at both ends."""
    wide = torch.nn.functional.max_pool1d(lift.reshape(len(lift), -1).T, 2 * _SOFTNESS + 1, 1, _SOFTNESS).T
    soft = smoothed(wide).reshape(lift.shape)
    ends = torch.minimum(torch.arange(len(lift)), torch.arange(len(lift)).flip(0)) / (2 * _SOFTNESS)
    ends = ends.clamp_max(1.0).reshape(-1, *[1] * (lift.ndim - 1))
    return torch.lerp(lift, torch.maximum(soft, lift), ends)


def smoothed(rows: Tensor) -> Tensor:
    """Rows [N, K] averaged with their neighbours; the ends stay."""
    for _ in range(_SOFTNESS):
        around = torch.cat([rows[:1], rows, rows[-1:]])
        middle = 0.25 * around[:-2] + 0.5 * around[1:-1] + 0.25 * around[2:]
        rows = torch.cat([rows[:1], middle[1:-1], rows[-1:]])
    return rows


def legs_bent(
    figure: Figure, seat: Seat, place: Bed, way: Way, hips: Tensor, world: Tensor, yaw: Tensor, share: Tensor
) -> Tensor:
    """Orientations with legs whose feet leave the floor, come round over the edge and stretch out."""
    thigh, _, foot, toes = figure.legs.T
    starts = figure.positions(hips, world)[:, thigh]
    up = torch.stack([eased(share, span) for span in _by_side(place, way.legs)], 1)[..., None]  # [N, 2, 1]
    ankles = _ankles(figure, seat, place, way, hips, yaw, up, share)
    bend = unit(0.6 * yaw[:, :, 2] + torch.tensor([0.0, 0.8, 0.0]))[:, None].expand_as(ankles)
    ankles = _lifted(figure, place, starts, ankles, bend)
    upper, lower = _leg_bones(figure, starts, ankles, bend)
    settled = eased(share, (0.7, 1.0))[:, None]
    lying = torch.from_numpy(seat.orientations)
    bent = world.clone()
    for column, bones in enumerate((upper, lower)):
        joint = figure.legs[:, column]
        bent[:, joint] = between(bones, lying[joint][None], settled)
    flat = (yaw[:1, None] @ torch.eye(3)).expand(len(yaw), 2, -1, -1)
    bent[:, foot] = between(between(flat, bent[:, figure.legs[:, 1]], up[..., 0]), lying[foot][None], settled)
    bent[:, toes] = between(bent[:, foot], lying[toes][None], settled)
    return bent


def _by_side(place: Bed, spans: tuple[Span, Span]) -> tuple[Span, Span]:
    """First and second as left and right: the leg that is nearer to the foot end goes first."""
    return spans if place.sense > 0 else (spans[1], spans[0])


def _ankles(
    figure: Figure, seat: Seat, place: Bed, way: Way, hips: Tensor, yaw: Tensor, up: Tensor, share: Tensor
) -> Tensor:
    """Where the ankles would be if nothing were in their way [N, 2, 3] [m]: left, right. `up` [N, 2, 1] tells how far
    each foot is on its way onto the furniture."""
    foot = figure.legs[:, 2]
    beside, ankle, back, ahead, above = (size(figure) * length for length in (_BESIDE, _ANKLE, HIPS_BACK, *_TUCKED))
    sides = torch.tensor([beside, -beside])
    floor = torch.stack([sides, torch.full((2,), ankle) - place.hips[0, 1], torch.full((2,), back)], 1)
    stands = hips[0] + (yaw[0] @ floor[..., None])[..., 0]  # does not move with the hips
    tucked = torch.stack([sides, torch.full((2,), above), torch.full((2,), ahead)], 1)
    comes = hips[:, None] + (yaw[:, None] @ tucked[..., None])[..., 0]
    later = (way.stretches[0] + _LATER, min(way.stretches[1] + _LATER, 1.0))
    out = torch.stack([eased(share, span) for span in _by_side(place, (way.stretches, later))], 1)[..., None]
    ends = hips[:, None] + torch.from_numpy(seat.positions[foot] - seat.positions[0])
    return torch.lerp(torch.lerp(stands.expand_as(comes), comes, up), ends, out)


def _knees(figure: Figure, starts: Tensor, ankles: Tensor, bend: Tensor) -> tuple[Tensor, Tensor]:
    """Knees and ankles [N, 2, 3] that legs from `starts` have, bent towards `bend`."""
    lengths = figure.lengths[figure.legs[:, 1], None], figure.lengths[figure.legs[:, 2], None]
    return _limb(starts, ankles, lengths, bend, (_FOLDED, _STRAIGHT))


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


def _lifted(figure: Figure, place: Bed, starts: Tensor, ankles: Tensor, bend: Tensor) -> Tensor:
    """Ankles [N, 2, 3] raised until shins and feet are over what is in their way."""
    if place.furniture is None:
        return ankles
    up, lift = torch.tensor([0.0, 1.0, 0.0]), torch.zeros(ankles.shape[:2])
    first: Tensor | None = None
    for _ in range(_ROUNDS):
        knees, ends = _knees(figure, starts, ankles + lift[..., None] * up, bend)
        ahead = ends + 0.12 * unit(bend * torch.tensor([1.0, 0.0, 1.0]))
        points = torch.stack([torch.lerp(knees, ends, 0.4), torch.lerp(knees, ends, 0.7), ends, ahead], 2)
        gap = place.furniture.distance(points.flatten(0, 2)[None])[0].reshape(points.shape[:3])
        depth = torch.tensor([0.05, 0.05, 0.05, 0.045]) + _SKIN - gap
        first = depth if first is None else first
        # What the ends themselves press into the furniture stays so.
        ends_press = torch.lerp(first[:1], first[-1:], torch.linspace(0, 1, len(depth))[:, None, None])
        lift = lift + (depth - ends_press.clamp_min(0.0)).amax(-1).clamp_min(0.0)
    return ankles + raised(lift)[..., None] * up


def hands_down(figure: Figure, place: Bed, way: Way, hips: Tensor, world: Tensor, yaw: Tensor, share: Tensor) -> Tensor:
    """Orientations with arms whose hands are put down on the furniture beside the trunk, and taken up again."""
    limbs, positions = limbs_of(figure), figure.positions(hips, world)
    turned = world.clone()
    right, left = (1, 0) if place.sense > 0 else (0, 1)  # the hand at the head end is the one at the open side
    for side, spans, aside in ((right, way.near, 1.0), (left, way.far, -1.0)):
        hand = _hand_place(figure, place, aside) if spans is not None else None
        if spans is None or hand is None:
            continue
        weight = (eased(share, spans[0]) * (1 - eased(share, spans[1])))[:, None]
        joints = limbs.arms[side]
        shoulder, elbow, wrist = positions[:, joints].unbind(1)
        lengths = vector_norm(elbow - shoulder, dim=-1, keepdim=True), vector_norm(wrist - elbow, dim=-1, keepdim=True)
        swings = shoulder + size(figure) * (_SWING[0] * aside * place.aside - torch.tensor([0.0, _SWING[1], 0.0]))
        target = torch.lerp(
            torch.lerp(wrist, swings, weight), torch.lerp(swings, hand.expand_as(wrist), weight), weight
        )
        out = torch.lerp(elbow - (shoulder + wrist) / 2, aside * place.aside - 0.5 * yaw[:, :, 2], weight)
        bent, end = _elbow(shoulder, target, lengths, out)
        upper = matrix_between(elbow - shoulder, bent - shoulder)
        lower = matrix_between((upper @ (wrist - elbow)[..., None])[..., 0], end - bent) @ upper
        tip = (lower @ world[:, joints[2]] @ limbs.hands[side][:, None])[..., 0]
        level = unit(tip * torch.tensor([1.0, 0.0, 1.0]) + 0.02 * aside * place.aside)
        flat = matrix_between(tip, torch.lerp(unit(tip), level, weight))
        turned[:, joints] = torch.stack([upper, lower, flat @ lower], 1) @ world[:, joints]
    return turned


def _hand_place(figure: Figure, place: Bed, aside: float) -> Tensor | None:
    """Where a wrist [3] is whose hand is put down on the open side (1) or the other one (-1); None where a rest is in
    its way."""
    back, beside = (size(figure) * length for length in _HAND)
    seated = float((place.hips[0] - place.hips[1]) @ place.aside)
    if aside > 0:
        beside = min(max(seated, beside), max(place.edge - _WITHIN * size(figure), 0.0))
    point = place.hips[1] + aside * beside * place.aside - back * place.along
    lying = float(place.hips[1, 1])
    if place.furniture is None:
        return point + torch.tensor([0.0, -0.05, 0.0])
    height = float(height_over(place.furniture, point, lying - 0.05, _WRIST))
    point[1] = height
    arm = [(above, out) for above in _ABOVE for out in _OUT]
    over = point + torch.stack([torch.tensor([0.0, above, 0.0]) + out * aside * place.aside for above, out in arm])
    free = bool((place.furniture.distance(over[None])[0] > _ROOM).all())
    return point if free and height < lying + _HIGHEST else None


def _elbow(shoulder: Tensor, wrist: Tensor, lengths: tuple[Tensor, Tensor], out: Tensor) -> tuple[Tensor, Tensor]:
    """Elbow and wrist [N, 3] of arms that reach for `wrist`, bent towards `out`."""
    return _limb(shoulder, wrist, lengths, out, (_FOLDED_ARM, _LONGEST))


def _limb(
    start: Tensor, end: Tensor, lengths: tuple[Tensor, Tensor], side: Tensor, bounds: tuple[float, float]
) -> tuple[Tensor, Tensor]:
    """Middle and end of limbs that reach for `end` and bend to a side; never folded or straighter than `bounds`."""
    upper, lower = lengths
    way = end - start
    reach = vector_norm(way, dim=-1, keepdim=True).clamp_min(1e-6)
    end = start + way * (reach.maximum((upper - lower).abs() + bounds[0]).minimum(bounds[1] * (upper + lower)) / reach)
    return bent_joint(start, end, lengths, side, straightest=bounds[1]), end
