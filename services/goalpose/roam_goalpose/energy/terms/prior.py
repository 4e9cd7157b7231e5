"""E_r: stay near the reference pose in the canonical space (paper Eq. 10; supplement C calls its weight lambda_p)."""

import torch
from roam_character.kinematics import forward_kinematics
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.reference import PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, squares


def canonical_positions(figure: Figure) -> Tensor:
    """Joint positions with root translation and orientation removed. -> [B, J, 3] [m]."""
    still = torch.zeros_like(figure.rotations[:, :1])
    still[..., 3] = 1.0
    rotations = torch.cat([still, figure.rotations[:, 1:]], dim=1)
    positions, _ = forward_kinematics(figure.skeleton, torch.zeros_like(figure.root_position), rotations)
    return positions


class Prior(Term):
    """mean_j |F(P'_c)_j - F(P_c)_j|^2 [m^2].

    The differences are taken in the world's axes, around the root: turning both changes no length.
    """

    name = "prior"
    symbol = "E_r"
    equation = "mean_j ‖F(P'_c)_j − F(P_c)_j‖² in the root's frame"
    weight = 30.0  # [1/m^2] joints 6 cm from the reference's pose cost 0.1
    published = 1e-2  # 1e-8 mm^-2
    internal = True

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """The canonical positions [1, J, 3]."""
        return PerReference(canonical_positions(reference.figure))

    def residual(self, scene: Scene) -> RobustLoss:
        """In the differences [B, 3 J] [m]."""
        figure, reference = scene.figure, scene.model.prepared[self.name]
        assert isinstance(reference, PerReference)
        expected = figure.positions[:, :1] + reference.values @ figure.axes[:, 0].transpose(-1, -2)
        return squares((figure.positions - expected).flatten(1), 1.0 / figure.positions.shape[1])

    def jacobian(self, scene: Scene) -> Tensor:
        """As the joints move; the root itself does not count. [B, 3 J, N]."""
        motion = scene.joint_motion
        return torch.cat([torch.zeros_like(motion[..., :6]), motion[..., 6:]], dim=-1)
