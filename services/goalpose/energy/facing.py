"""E_o: the sitter faces the object's front as the reference does (beyond the paper).

The field sees the front of an object (`goalpose.field.frame`): a direction on the floor, as long as front and back
differ, about 1 for chairs and near 0 for round stools. The reference's front, carried by its pelvis, shall be the
target's; a reference without a front (a stool's) fits an object with one as badly as one that looks aside.
"""

from character.rotation import quat_inv, quat_rotate
from torch import Tensor

from goalpose.energy.chain import point_motion
from goalpose.energy.figure import Figure


def front_seen_by_pelvis(figure: Figure, front: Tensor) -> Tensor:
    """The front `[3]` of the reference object in the frame of the reference's pelvis. -> [3]."""
    return quat_rotate(quat_inv(figure.orientations[:1, 0]), front[None])[0]


def facing_energy(figure: Figure, carried: Tensor, front: Tensor) -> Tensor:
    """E_o = |R_pelvis c - f|^2 for the carried front c [3] and the target's front f [3]. -> [B] [1]."""
    return (_world(figure, carried) - front).square().sum(-1)


def facing_rows(figure: Figure, carried: Tensor, front: Tensor) -> tuple[Tensor, Tensor]:
    """Residuals [B, 3] and their motion [B, 3, N], for Gauss-Newton."""
    world = _world(figure, carried)
    origin = figure.positions[:, :1]
    joint = figure.skeleton.index("hips")
    ahead = point_motion(figure, origin.new_tensor([joint]).long(), origin + world[:, None])
    here = point_motion(figure, origin.new_tensor([joint]).long(), origin)
    return world - front, (ahead - here).flatten(1, 2)


def _world(figure: Figure, carried: Tensor) -> Tensor:
    return quat_rotate(figure.orientations[:, 0], carried.expand(len(figure), 3))
