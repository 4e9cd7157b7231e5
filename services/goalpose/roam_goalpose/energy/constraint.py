"""E_w: what the caller asked for besides a good pose: where to sit, where to face, where the hands go.

Optional wishes, weighed like the other terms: a seat point in mid air does not tear the body off the object.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.chain import Chain
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.rows import Bend, squares
from roam_goalpose.objects.own_axes import Placement

Point = tuple[float, float, float]
HANDS = ("left", "right")
NEAR, ASIDE = 0.05, 0.2  # [m], [rad]: misses that count 1 each


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """Wishes of the caller, in world coordinates; whatever is None or empty is free."""

    seat_point: Point | None = None  # [m] the hips go above it; its height only chooses the surface
    facing: float | None = None  # [rad] heading of the pelvis
    hands: tuple[tuple[str, Point], ...] = ()  # "left" or "right", and where the middle of that hand goes [m]

    @property
    def given(self) -> bool:
        """Whether there are any."""
        return self.seat_point is not None or self.facing is not None or bool(self.hands)

    @property
    def rigid(self) -> "Constraints":
        """Those that moving the whole body can meet: nobody slides along a bench to reach an arm rest."""
        return replace(self, hands=())


NONE = Constraints()


def constraints_in(wishes: Constraints, placement: Placement) -> Constraints:
    """The wishes in the object's own axes."""

    def own(point: Point) -> Point:
        x, y, z = (float(v) for v in placement.point_to_own(np.array(point)))
        return x, y, z

    return Constraints(
        seat_point=None if wishes.seat_point is None else own(wishes.seat_point),
        facing=None if wishes.facing is None else wishes.facing - placement.yaw,
        hands=tuple((side, own(goal)) for side, goal in wishes.hands),
    )


def constraint(misses: Tensor) -> Bend:
    """E_w = |hips - s|^2 / (5 cm)^2 on the floor plan + |l - l_w|^2 / (0.2 rad)^2 + sum_h |hand - h|^2 / (5 cm)^2.

    l is the pelvis's left side, which also says where a lying person faces; `misses` [B, K] from below; unit 1.
    """
    return squares(misses)


def constraint_misses(figure: Figure, wishes: Constraints) -> Tensor:
    """The scaled misses of all wishes. -> [B, K]."""
    parts = []
    if wishes.seat_point is not None:
        apart = figure.root_position - figure.positions.new_tensor(wishes.seat_point)
        parts.append(apart[:, [0, 2]] / NEAR)
    if wishes.facing is not None:
        left = figure.positions.new_tensor([math.cos(wishes.facing), 0.0, -math.sin(wishes.facing)])
        parts.append((figure.axes[:, 0, :, 0] - left) / ASIDE)
    if wishes.hands:
        joint, offset, goal = _hands(figure.skeleton, wishes)
        parts.append(((figure.attached(joint, offset) - goal) / NEAR).flatten(1))
    return torch.cat(parts, dim=1)


def constraint_motion(chain: Chain, figure: Figure, wishes: Constraints) -> Tensor:
    """How the misses move with the unknowns. -> [B, K, N]."""
    hips = torch.tensor([0])
    parts = []
    if wishes.seat_point is not None:
        parts.append(chain.anyhow(hips, figure.positions[:, :1])[:, [0, 2]] / NEAR)
    if wishes.facing is not None:
        parts.append(chain.turning(hips, figure.axes[:, :1, :, 0]) / ASIDE)
    if wishes.hands:
        joint, offset, _ = _hands(figure.skeleton, wishes)
        parts.append(chain.anyhow(joint, figure.attached(joint, offset)) / NEAR)
    return torch.cat(parts, dim=1)


def _hands(skeleton: Skeleton, wishes: Constraints) -> tuple[Tensor, Tensor, Tensor]:
    """Joints [H], middles of the hands in the joints' frames [H, 3] and goals [H, 3] of the hands that have one."""
    joints = [skeleton.index(f"{side}Hand") for side, _ in wishes.hands]
    tips = {tip.parent: tip.offset for tip in skeleton.tips}
    middles = [[0.5 * x for x in tips.get(joint, (0.0, 0.0, 0.0))] for joint in joints]
    return torch.tensor(joints), torch.tensor(middles), torch.tensor([goal for _, goal in wishes.hands])
