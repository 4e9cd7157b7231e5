"""E_w: what the caller asked for (`energy/constraints.py`).

Optional wishes, weighed like the other terms: a seat point in mid air does not tear the body off the object.
"""

import math

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.chain import Chain
from roam_goalpose.energy.constraints import Constraints
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.scene import Scene, Target
from roam_goalpose.energy.term import RobustLoss, Term, squares

NEAR, ASIDE = 0.05, 0.2  # [m], [rad]: misses that count 1 each


class Constraint(Term):
    """|hips - s|^2 / (5 cm)^2 on the floor plan + |l - l_w|^2 / (0.2 rad)^2 + sum_h |hand - h|^2 / (5 cm)^2.

    l is the pelvis's left side, which also says where a lying person faces.
    """

    name = "constraint"
    symbol = "E_w"
    equation = "‖hips − s‖² / (5 cm)² + ‖left − l‖² / (0.2 rad)² + Σ_h ‖hand − h‖² / (5 cm)² of the wishes"
    weight = 0.3  # a wish missed by 5 cm or 0.2 rad costs this
    coarse = True

    def applies(self, target: Target) -> bool:
        """When there are wishes."""
        return target.constraints.given

    def residual(self, scene: Scene) -> RobustLoss:
        """The squared misses."""
        return squares(constraint_misses(scene.figure, scene.target.constraints))

    def jacobian(self, scene: Scene) -> Tensor:
        """How the misses move. [B, K, N]."""
        return constraint_motion(scene.chain, scene.figure, scene.target.constraints)


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
        parts.append(chain.free(hips, figure.positions[:, :1])[:, [0, 2]] / NEAR)
    if wishes.facing is not None:
        parts.append(chain.turning(hips, figure.axes[:, :1, :, 0]) / ASIDE)
    if wishes.hands:
        joint, offset, _ = _hands(figure.skeleton, wishes)
        parts.append(chain.free(joint, figure.attached(joint, offset)) / NEAR)
    return torch.cat(parts, dim=1)


def _hands(skeleton: Skeleton, wishes: Constraints) -> tuple[Tensor, Tensor, Tensor]:
    """Joints [H], middles of the hands in the joints' frames [H, 3] and goals [H, 3] of the hands that have one."""
    joints = [skeleton.index(f"{side}Hand") for side, _ in wishes.hands]
    tips = {tip.parent: tip.offset for tip in skeleton.tips}
    middles = [[0.5 * x for x in tips.get(joint, (0.0, 0.0, 0.0))] for joint in joints]
    return torch.tensor(joints), torch.tensor(middles), torch.tensor([goal for _, goal in wishes.hands])
