"""E_g: pelvis, chest and head keep the reference's lean (beyond the paper).

Furniture stands upright in the world, so a sitter's tilt against gravity is part of the reference; the descriptors,
blind to gravity by design, let near-symmetric objects (a cube stool) pull the body over.
"""

from functools import cache

import torch
from roam_character.rotation import quat_inv, quat_rotate
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.reference import PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, squares

UPRIGHT_JOINTS = ("hips", "upperChest", "head")
_UP = torch.tensor([0.0, 1.0, 0.0])


@cache
@torch.inference_mode(mode=False)
def upright_joints(skeleton: Skeleton) -> Tensor:
    """Pelvis, chest and head. -> [3]."""
    return torch.tensor(skeleton.indices(UPRIGHT_JOINTS))


def gravity_directions(figure: Figure) -> Tensor:
    """World up as seen by pelvis, chest and head: independent of yaw. -> [B, 3, 3]."""
    orientations = figure.orientations[:, upright_joints(figure.skeleton)]
    return quat_rotate(quat_inv(orientations), _UP.to(orientations).expand(*orientations.shape[:-1], 3))


class Gravity(Term):
    """mean_k |g_k - g_k^ref|^2, about the squared tilt for small angles [rad^2]."""

    name = "gravity"
    symbol = "E_g"
    equation = "mean_k ‖g_k − g_k^ref‖² for pelvis, chest, head"
    weight = 2.0  # [1/rad^2] a trunk tilted by 18 degrees costs about 0.1

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """Up as the joints see it [1, 3, 3]."""
        return PerReference(gravity_directions(reference.figure))

    def residual(self, scene: Scene) -> RobustLoss:
        """In the differences of the carried up directions from up [B, 9]."""
        carried = self.carried(scene)
        return squares((carried - _UP.to(carried)).flatten(1), 1.0 / carried.shape[1])

    def jacobian(self, scene: Scene) -> Tensor:
        """How the carried directions turn. [B, 9, N]."""
        return scene.chain.turning(upright_joints(scene.model.skeleton), self.carried(scene))

    def carried(self, scene: Scene) -> Tensor:
        """The reference's up directions, carried by the pose's joints, in the world. [B, 3, 3]."""
        reference = scene.model.prepared[self.name]
        assert isinstance(reference, PerReference)
        return scene.once(
            "carried up", lambda: scene.figure.directed(upright_joints(scene.model.skeleton), reference.values)
        )
