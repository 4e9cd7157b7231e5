"""E_c: the body's capsules stay out of the object (beyond the paper, which asks for it in section E)."""

from torch import Tensor

from roam_goalpose.energy.reference import PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term

GIVE = 0.012  # [m] how much flesh and cushion give everywhere


def penetration(distance: Tensor, radius: Tensor, allowance: Tensor) -> RobustLoss:
    """E_c = mean_p max(r_p - d_p - a_p, 0)^2 [m^2].

    `distance` [B, P] of the spheres' centres, their `radius` [P], `allowance` a [1 or B, P]: flesh and cushions give.
    """
    depth = (radius - distance - allowance).clamp(min=0.0)
    share = 2.0 / distance.shape[-1]
    return RobustLoss(depth.square().mean(-1), -share * depth, share * (depth > 0))


class Penetration(Term):
    """Spheres of the body deeper in the object than the reference's are in theirs."""

    name = "penetration"
    symbol = "E_c"
    equation = "mean_p max(r_p − d(x_p) − a_p, 0)² over spheres of the body"
    weight = 10000.0  # [1/m^2] five spheres of the body 2.5 cm too deep cost 0.1 each
    coarse = True

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """How deep every sphere may lie [1, P] [m]."""
        return PerReference((reference.body.radius - reference.clearances).clamp(min=GIVE))

    def residual(self, scene: Scene) -> RobustLoss:
        """In the clearances [B, P]."""
        allowance = scene.model.prepared[self.name]
        assert isinstance(allowance, PerReference)
        return penetration(scene.clearances, scene.model.body.radius, allowance.values)

    def jacobian(self, scene: Scene) -> Tensor:
        """How the clearances move. [B, P, N]."""
        return scene.clearance_motion
