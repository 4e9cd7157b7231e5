"""Steps by rule: who stands keeps both feet where they are, and shifts one at a time when the body has turned from it.

A network that answers the mean of all steps that people might take takes none: the feet stay, the pelvis turns, and the
legs end crossed. So while somebody stands or turns on the spot, the feet are moved by a rule: the foot that is farthest
from its place under the body, beyond what people allow, is lifted and set down there; the other one carries the body
meanwhile. Where somebody goes on, the network's own steps count.
"""

import math
from dataclasses import dataclass

import torch
from roam_character.matrices import unit
from roam_character.tensors.elementary import arctangent, cosine, sine
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.animation.figure import Figure
from roam_motion.animation.manner import of
from roam_motion.animation.prediction import Goals
from roam_motion.animation.proportions import leg_length, size
from roam_motion.animation.state import Characters

BEHIND = 0.10  # [m] ankles of a standing body behind its root: captured standing 0.07 / 0.12 / 0.13 (5, 50, 95 %)
# Mean and deviation of people: ankle beside the middle [m] (captured standing 0.07 / 0.13 / 0.20), and toes turned out
# [rad] (3 / 15 / 24 degrees).
_ASIDE, _OUT = (0.12, 0.02), (math.radians(12), math.radians(5))
_GONE = 0.13, 0.22  # [m] way of the goals in a second below which one stands, above which one goes; tuned on turns
_CHANGE = 1 / 6  # per frame, from going to standing and back
_KEY = 2  # of the goals: feet step to where the body will be in a third of a second
# A foot steps that is so far from its place on the floor [m], turned from it [rad] (people's: 17 degrees, median), or
# whose heel is up [m].
_MISPLACED = 0.14, math.radians(30), 0.035
_EXACTLY = 0.06  # [m] the same, before a seat: captured feet move 0.02 to 0.04 m after contact with it
_OVER_SEAT = 0.15  # [m] over the goal's hips the seat begins to count: nobody steps any more
_FRAMES = 12  # of a step: captured turns on the spot lift a foot for 0.35 to 0.45 s
_LANDING = 0.5  # share of its step that a foot has behind it which is in the air when one comes to stand
_LIFT = 0.055  # [m] of the ankle: tuned on turns on the spot
_FLAT = 0.081  # [m] height of the ankle of a foot that stands, captured
_LEVEL = 0.393  # of a flat foot's length: the ankle is higher than the toes by so much, captured
_AIRBORNE = 0.105  # [m] an ankle higher than this does not stand
_UPRIGHT = 0.80  # share of the hips' standing height from which one stands: seated hips are at 0.55 to 0.7 of it
_STEPPING = 0.90  # the same, from which one begins a step: nobody lifts a foot who sits down already
_TALL = 0.985  # share of its length to which the straighter leg is stretched: captured standing 0.974 / 0.983 / 0.985
_RISE = 0.008, 0.3  # [m], and share of what is missing, that hips rise per frame at most


def pose_feet(figure: Figure, positions: Tensor) -> Tensor:
    """Where the feet of poses with joints [B, J, 3] are, as `Goals.feet` [B, 2, 4]; 0 where they hang in the air."""
    joints = positions[:, figure.contacts].unflatten(1, (2, 2))
    feet = torch.cat([joints[:, :, 0, ::2], unit((joints[:, :, 1] - joints[:, :, 0])[..., ::2])], -1)
    return feet * (joints[:, :, 0, 1].amax(1) < _AIRBORNE * size(figure)).float()[:, None, None]


@dataclass(frozen=True)
class Steps:
    """What the rule wants of both feet."""

    standing: Tensor  # [B] 0 going .. 1 standing
    progress: Tensor  # [B, 2] of the step a foot takes, 0 on the ground .. 1 landing
    share: Tensor  # [B, 2] how much of a foot's place is the rule's and not the network's
    stays: Tensor  # [B, 2] bool: on the ground, whatever the network says
    landed: Tensor  # [B, 2] bool: was set down in the last frame


def step(figure: Figure, characters: Characters, goals: Goals, before: Tensor, wanted: Tensor) -> tuple[Steps, Tensor]:
    """The rule's steps, and `wanted` [B, J, 3] with the feet where they are on them. `before` [B, J, 3] shown last."""
    last = before[:, figure.contacts]
    high = characters.hips[:, 1] / standing_height(figure)
    standing = _standing(figure, characters, goals, high)
    ruled = (standing > 0.5)[:, None]
    ankle, arm = last[:, ::2], last[:, 1::2] - last[:, ::2]
    places, ways = _places(figure, characters, goals, ankle, arm)
    landed = characters.steps >= 1
    gone = torch.where(landed, torch.zeros_like(characters.steps), characters.steps)
    gone = _begun(
        figure,
        characters,
        gone,
        ankle,
        _error(figure, goals, ankle, arm, places, ways),
        ruled & (high > _STEPPING)[:, None],
    )
    moving = (gone > 0) & (standing > 0)[:, None]
    progress = torch.where(moving, (gone + 1 / _FRAMES).clamp_max(1.0), torch.zeros_like(gone))
    progress = torch.where(progress > 1 - 0.5 / _FRAMES, progress.new_ones(()), progress)
    left = ((1 - _smooth(progress)) / (1 - _smooth(gone)).clamp_min(1e-3))[..., None]
    lift = size(figure) * (_arc(progress) - left[..., 0] * _arc(gone))
    ankle = places + left * (ankle - places)
    ankle = torch.stack([ankle[..., 0], ankle[..., 1] + lift, ankle[..., 2]], -1)
    feet = torch.stack([ankle, ankle + _turned(figure, arm, ways, left)], 2).flatten(1, 2)
    share = torch.where(moving, (2 * standing[:, None]).clamp_max(1.0), torch.zeros_like(progress))
    steps = Steps(standing, progress, share, ruled & ~moving, landed & ruled)
    placed = torch.lerp(wanted[:, figure.contacts], feet, share.repeat_interleave(2, 1)[..., None])
    return steps, wanted.index_copy(1, figure.contacts, placed)


def halted(figure: Figure, before: Tensor, wanted: Tensor, clear: Tensor, stopped: Tensor) -> Tensor:
    """Joints [B, J, 3] with the feet of steps that furniture stops [B, 2] set down where they are, not in it.

    `before` are the joints shown last, `wanted` those that the step leads to, `clear` those pushed out of furniture.
    """
    here, there, out = (joints[:, figure.contacts] for joints in (before, wanted, clear))
    level = torch.tensor([1.0, 0.0, 1.0])
    stays = out + level * (here - there)
    feet = torch.where(stopped.repeat_interleave(2, 1)[..., None], stays, out)
    return clear.index_copy(1, figure.contacts, feet)


def rise(figure: Figure, steps: Steps, joints: Tensor, ankles: Tensor) -> Tensor:
    """What a body at `joints` [B, J, 3] with its feet at `ankles` [B, 2, 3] rises by [B, 3] [m].

    Who stands stands tall: the straighter of the legs that carry the body is nearly straight.
    """
    thighs = joints[:, figure.legs[:, 0]]
    across = (thighs - ankles)[..., ::2].square().sum(-1)
    straight = ((_TALL * leg_length(figure)) ** 2 - across).clamp_min(0.0).sqrt()
    missing = ankles[..., 1] + straight - thighs[..., 1]
    missing = torch.where(steps.progress > 0, missing.new_full((), math.inf), missing).amin(-1)
    up = torch.minimum(_RISE[1] * missing, missing.new_full((), _RISE[0] * size(figure))).clamp_min(0.0)
    return torch.stack([torch.zeros_like(up), steps.standing * up, torch.zeros_like(up)], -1)


def standing_height(figure: Figure) -> float:
    """The hips' height over the floor on straight legs [m]."""
    return leg_length(figure) - float(figure.offsets[figure.legs[:, 0], 1].mean()) + _FLAT * size(figure)


def _standing(figure: Figure, characters: Characters, goals: Goals, high: Tensor) -> Tensor:
    """How much each one stands [B]: with goals that lead nowhere, upright, or not yet near the seat that it takes."""
    gone = vector_norm(goals.positions[:, 6] - goals.positions[:, 0], dim=-1) / size(figure)
    change = (gone < _GONE[0]).float() - (gone > _GONE[1]).float()
    seat = goals.pose_positions[:, 0, 1] + _OVER_SEAT * size(figure)
    able = torch.where(goals.active > 0.5, characters.hips[:, 1] > seat, high > _UPRIGHT)
    able = able & ((goals.active < 0.5) | _given(goals))
    change = torch.where(able, change, -torch.ones_like(change))
    return (characters.standing + _CHANGE * change).clamp(0.0, 1.0)


def _places(figure: Figure, characters: Characters, goals: Goals, ankle: Tensor, arm: Tensor) -> tuple[Tensor, Tensor]:
    """Where both ankles belong [B, 2, 3] [m], and the directions [B, 2, 2] that their feet point to.

    Before a seat whose pose has its feet in the air they belong where they are: `ankle` and `arm` [B, 2, 3].
    """
    ahead, scale = goals.directions[:, _KEY], size(figure)
    left = torch.stack([ahead[:, 1], -ahead[:, 0]], -1)
    sides = torch.tensor([1.0, -1.0])[:, None]
    aside = scale * (_ASIDE[0] + _ASIDE[1] * of(characters.manner, "stance"))[:, None, None] * sides
    out = (_OUT[0] + _OUT[1] * of(characters.manner, "toes"))[:, None, None]
    middle = (goals.positions[:, _KEY] - BEHIND * scale * ahead)[:, None]
    floor = middle + aside * left[:, None]
    height = torch.full_like(floor[..., 0], _FLAT * scale)
    ways = cosine(out) * ahead[:, None] + sine(out) * sides * left[:, None]
    given = _given(goals)[:, None, None]
    floor, ways = torch.where(given, goals.feet[..., :2], floor), torch.where(given, goals.feet[..., 2:], ways)
    here = ((goals.active > 0.5) & ~_given(goals))[:, None, None]
    floor, ways = torch.where(here, ankle[..., ::2], floor), torch.where(here, unit(arm[..., ::2]), ways)
    return torch.stack([floor[..., 0], height, floor[..., 1]], -1), ways


def _given(goals: Goals) -> Tensor:
    """Whether the goal says where feet belong [B]."""
    return goals.feet[:, 0, 2:].abs().sum(-1) > 0


def _error(figure: Figure, goals: Goals, ankle: Tensor, arm: Tensor, places: Tensor, ways: Tensor) -> Tensor:
    """How far each foot [B, 2] is from its place: 1 where it should step."""
    apart = vector_norm((ankle - places)[..., ::2], dim=-1) / size(figure)
    apart = apart / torch.where(_given(goals), apart.new_full((), _EXACTLY), _MISPLACED[0])[:, None]
    raised = (ankle[..., 1] / size(figure) - _FLAT) / _MISPLACED[2]
    return torch.maximum(torch.maximum(apart, raised), _angle(arm[..., ::2], ways).abs() / _MISPLACED[1])


def _begun(
    figure: Figure, characters: Characters, progress: Tensor, ankle: Tensor, error: Tensor, free: Tensor
) -> Tensor:
    """Progress [B, 2] with steps that begin: of a foot in the air, which lands, else of the foot that is worst off."""
    airborne = ankle[..., 1] > _AIRBORNE * size(figure)
    landing = free & airborne & (progress <= 0) & (characters.lock_weights[:, ::2] < 1)
    progress = torch.where(landing, progress.new_full((), _LANDING), progress)
    nobody = (progress <= 0).all(-1, keepdim=True)
    worst = error >= error.flip(-1)
    worst = worst & ~(worst.all(-1, keepdim=True) & torch.tensor([False, True]))  # both alike: the left one
    begins = free & nobody & worst & (error > 1)
    return torch.where(begins, progress.new_full((), 1e-6), progress)


def _turned(figure: Figure, arm: Tensor, ways: Tensor, left: Tensor) -> Tensor:
    """Ankle-to-toes vectors [B, 2, 3] on their way to flat feet that point along `ways`."""
    angle = _angle(arm[..., ::2], ways)
    turn = angle[..., None] * (1 - left)
    sine_of, cosine_of = sine(turn)[..., 0], cosine(turn)[..., 0]
    x, z = arm[..., 0], arm[..., 2]
    flat = unit(torch.stack([x * cosine_of + z * sine_of, z * cosine_of - x * sine_of], -1))
    length = figure.lengths[figure.legs[:, 3]]
    level = -_LEVEL * length
    down = level + left[..., 0] * (arm[..., 1] - level)
    across = (length.square() - down.square()).clamp_min(1e-6).sqrt()[..., None] * flat
    return torch.stack([across[..., 0], down, across[..., 1]], -1)


def _angle(here: Tensor, there: Tensor) -> Tensor:
    """The turn [...] [rad] about the vertical from floor directions (x, z) `here` to `there` [..., 2]."""
    return arctangent(here[..., 1] * there[..., 0] - here[..., 0] * there[..., 1], (here * there).sum(-1))


def _smooth(share: Tensor) -> Tensor:
    return share * share * (3 - 2 * share)


def _arc(share: Tensor) -> Tensor:
    """Height of an ankle on its step [m]: 0 at both ends."""
    return _LIFT * sine(torch.pi * share)
