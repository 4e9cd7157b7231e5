"""E_n: every part of the body is as far from the object as in the reference (beyond the paper).

The signed distance is a descriptor of one number that needs no training: it tells a seat with a back from one
without, the side of an armrest from the room in front of the knees. It keeps the learned descriptors honest on
objects unlike any that the field was trained on.
"""

from torch import Tensor

from roam_goalpose.energy.reference import FAR, PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, geman_mcclure

SCALE = 0.1  # [m] of the Geman-McClure function: beyond it a difference is a difference


def clearance(distance: Tensor, reference: Tensor) -> RobustLoss:
    """E_n = mean_p e_p^2 / (e_p^2 + s^2), e_p the difference in clearance: in [0, 1].

    `distance` [B, P] of the body's spheres from the object [m], `reference` [1 or B, P] the same in the reference
    pair, at most `FAR`.
    """
    found = geman_mcclure(distance.clamp(max=FAR) - reference, SCALE, 1.0 / distance.shape[-1])
    near = distance < FAR
    return RobustLoss(found.energy, found.slope * near, found.stiffness * near)


class Clearance(Term):
    """Robust differences of the clearances from the reference's."""

    name = "clearance"
    symbol = "E_n"
    equation = "mean_p ρ(d(x_p) − d_p): every part as far from the object as in the reference"
    weight = 0.7

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """The reference's clearances [1, P] [m]."""
        return PerReference(reference.clearances)

    def residual(self, scene: Scene) -> RobustLoss:
        """In the clearances [B, P]."""
        reference = scene.model.prepared[self.name]
        assert isinstance(reference, PerReference)
        return clearance(scene.clearances, reference.values)

    def jacobian(self, scene: Scene) -> Tensor:
        """How the clearances move. [B, P, N]."""
        return scene.clearance_motion
