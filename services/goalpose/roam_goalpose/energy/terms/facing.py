"""E_o: the sitter faces the object's front as the reference does (beyond the paper).

An object's front is opposite to its back (`roam_goalpose.objects.placing.heading`): a direction on the floor, as long
as front and back differ, 1 for chairs and 0 for stools. The reference's front, carried by its pelvis, shall be the
target's. A stool has none; there the person's own front counts a little, so that it fits an object with a front nearly
as badly as one that looks aside, but nobody sits on a sofa's edge sideways.
"""

import torch
from roam_character.rotation import quat_inv, quat_rotate
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.reference import PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, squares

OWN_FRONT = 0.25  # how much a person's own front counts where the object has none


def front_seen_by_pelvis(figure: Figure, front: Tensor) -> Tensor:
    """The front `[3]` of the reference object, or its person's, in the frame of the reference's pelvis. -> [3]."""
    left = figure.axes[0, 0, :, 0]
    own = torch.linalg.cross(left, torch.tensor([0.0, 1.0, 0.0]))
    seen = torch.where(front.norm() < OWN_FRONT, OWN_FRONT * own, front)
    return quat_rotate(quat_inv(figure.orientations[:1, 0]), seen[None])[0]


def carried_front(figure: Figure, reference: PerReference) -> Tensor:
    """The reference's front, carried [1 or B, 3] by the pelvis, in the world. -> [B, 1, 3]."""
    return (figure.axes[:, 0] @ reference.values[..., None]).transpose(1, 2)


def facing(seen: Tensor, front: Tensor) -> RobustLoss:
    """E_o = |R_pelvis c - f|^2 for the carried front `seen` [B, 1, 3] and the target's `front` f [3]; unit 1."""
    return squares((seen - front).flatten(1))


class Facing(Term):
    """The reference's front against the target's."""

    name = "facing"
    symbol = "E_o"
    equation = "‖R_pelvis c − f‖² of the fronts of reference (carried by the pelvis) and target, away from their backs"
    weight = 0.5
    coarse = True

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """The front as the pelvis sees it [1, 3]."""
        return PerReference(front_seen_by_pelvis(reference.figure, reference.front)[None])

    def residual(self, scene: Scene) -> RobustLoss:
        """In the difference [B, 3]."""
        return facing(self.seen(scene), scene.target.front)

    def jacobian(self, scene: Scene) -> Tensor:
        """How the carried front turns. [B, 3, N]."""
        return scene.chain.turning(torch.zeros(1, dtype=torch.long), self.seen(scene))

    def seen(self, scene: Scene) -> Tensor:
        """The reference's front in the world. [B, 1, 3]."""
        reference = scene.model.prepared[self.name]
        assert isinstance(reference, PerReference)
        return scene.once("carried front", lambda: carried_front(scene.figure, reference))
