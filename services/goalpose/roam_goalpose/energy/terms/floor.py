"""E_f: nothing below the floor (paper Eq. 9)."""

from torch import Tensor

from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term


class Floor(Term):
    """sum_j min(y_j - G_y, 0)^2 [m^2] of the joints' heights over the floor."""

    name = "floor"
    symbol = "E_f"
    equation = "Σ_j min(y_j − G, 0)²"
    weight = 100.0  # [1/m^2] one joint 3 cm under the floor costs 0.1
    published = 1e-2  # 1e-8 mm^-2

    def residual(self, scene: Scene) -> RobustLoss:
        """In the heights [B, J]."""
        depth = scene.heights.clamp(max=0.0)
        return RobustLoss(depth.square().sum(-1), 2 * depth, 2.0 * (depth < 0))

    def jacobian(self, scene: Scene) -> Tensor:
        """How the heights move. [B, J, N]."""
        return scene.joint_motion[:, 1::3]
