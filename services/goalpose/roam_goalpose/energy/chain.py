"""How points fixed to the skeleton move with its degrees of freedom: closed-form Jacobians.

The unknowns are root translation and one local rotation vector per joint, R_k exp(v_k): N = 3 + 3 J numbers. A point
x on joint j moves with v_k of every joint k from the root to j by (O_k v_k) x (x - o_k). Along a direction n that is
the product of the wrench (x x n, n) with the joint's screw: one matrix product for all points and all unknowns.
"""

from dataclasses import dataclass
from functools import cache

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.figure import Figure


def _axis_wrenches() -> tuple[Tensor, Tensor]:
    """The wrenches of a point along x, y and z, (x x e_i, e_i) [18], as x times the first [3, 18] and the second."""
    along = torch.eye(3)
    moments = torch.zeros(3, 3, 6)
    moments[:, :, :3] = torch.linalg.cross(along[:, None].expand(3, 3, 3), along.expand(3, 3, 3), dim=-1)
    forces = torch.cat([torch.zeros(3, 3), along], dim=-1)
    return moments.flatten(1), forces.flatten()


_MOMENTS, _FORCES = _axis_wrenches()


@cache
@torch.inference_mode(mode=False)
def carriers(skeleton: Skeleton) -> Tensor:
    """Which unknowns move which joints: [J, 3 + 3 J], 1 for the root's shift and the turns of a joint and all above."""
    above = torch.tensor(skeleton.ancestors)
    return torch.cat([torch.ones(len(above), 3), above.repeat_interleave(3, dim=1)], dim=1)


@dataclass(frozen=True, eq=False)
class Chain:
    """The joints of B poses as screws."""

    screws: Tensor  # [B, 6, N]
    carried: Tensor  # [J, N]

    @classmethod
    def of(cls, figure: Figure, *, joints: bool = True) -> "Chain":
        """Screws along the world's axes for the root's shift, and about every joint's local axes: N = 3 + 3 J.

        Without `joints` only the root moves, N = 6.
        """
        batch, count = len(figure), figure.positions.shape[1] if joints else 1
        axes = figure.axes[:, :count].transpose(-1, -2)  # [B, J, axis, xyz]
        moments = torch.linalg.cross(axes, -figure.positions[:, :count, None], dim=-1)
        turning = torch.cat([axes, moments], dim=-1).reshape(batch, 3 * count, 6).transpose(1, 2)
        shifting = torch.cat([torch.zeros(3, 3), torch.eye(3)]).expand(batch, 6, 3)
        return cls(torch.cat([shifting, turning], dim=-1), carriers(figure.skeleton)[:, : 3 + 3 * count])

    def along(self, joint: Tensor, points: Tensor, directions: Tensor) -> Tensor:
        """d(n . x)/d(unknowns) for points [B, P, 3] on joints [P] or [B, P], along `directions` [B, P, 3].

        -> [B, P, N].
        """
        wrenches = torch.cat([torch.linalg.cross(points, directions, dim=-1), directions], dim=-1)
        return self._moved(wrenches, joint)

    def free(self, joint: Tensor, points: Tensor) -> Tensor:
        """`along` x, y and z for points [B, P, 3] on joints [P]. -> [B, 3 P, N], point by point."""
        wrenches = (points @ _MOMENTS + _FORCES).unflatten(-1, (3, 6)).flatten(1, 2)
        return self._moved(wrenches, joint.repeat_interleave(3))

    def _moved(self, wrenches: Tensor, joint: Tensor) -> Tensor:
        """From wrenches [B, P, 6] at joints [P] or [B, P] to what the unknowns do along them. -> [B, P, N]."""
        carried = self.carried.index_select(0, joint.flatten()).unflatten(0, joint.shape)
        return (wrenches @ self.screws).mul_(carried)

    def turning(self, joint: Tensor, vectors: Tensor) -> Tensor:
        """d(v)/d(unknowns) for directions v [B, K, 3] that turn with joints [K]. -> [B, 3 K, N]."""
        axes = torch.eye(3).repeat(vectors.shape[1], 1).expand(len(vectors), -1, -1)
        moments = torch.linalg.cross(vectors.repeat_interleave(3, dim=1), axes, dim=-1)
        carried = self.carried.index_select(0, joint.repeat_interleave(3))
        return (moments @ self.screws[:, :3]).mul_(carried)
