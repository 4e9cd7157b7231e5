"""E_s: touch the object where the reference touches it, and the floor with the soles (beyond the paper)."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import torch
from roam_character.rotation import quat_inv, quat_rotate
from torch import Tensor

from roam_goalpose.energy.body import BodyPoints
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.object import SignedDistance
from roam_goalpose.energy.reference import PRESS, ReferenceModel, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, geman_mcclure

SUPPORT, LEAN, FLOOR, ARMS = GROUPS = range(4)  # from below; from behind or the side; the soles; the arms
GROUP_WEIGHTS = (0.35, 0.25, 0.3, 0.1)  # of the groups, in that order
SCALE = 0.05  # [m] of the Geman-McClure function: a contact missed by more is missed
REACH = 0.03  # [m] between surface and body at which they touch
UPWARD = 0.7  # cosine of the steepest surface that holds a body from below
RIBS = 0.10  # [m] from the spine to the side of the back
GROUNDED = 0.12  # [m] a foot or toe joint lower than this over the floor stands on it
_ARMS = ("UpperArm", "LowerArm", "Hand")
_TRUNK = ("spine", "chest", "upperChest")
_LEGS = ("UpperLeg", "LowerLeg", "Foot", "Toes")
_UP = torch.tensor([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Contacts:
    """K body-fixed points of R references that lie on the object's surface (or the floor) in the reference pair.

    A sphere of the body at distance d from the surface with outward normal n touches at x - d n: if that point is on
    the target's surface too and the sphere is outside, the target's surface faces the body from the same side.
    """

    joint: Tensor  # [R, K]
    offset: Tensor  # [R, K, 3] in the joint's frame [m]
    rest: Tensor  # [R, K] signed distance in the reference pair, about 0 [m]
    weight: Tensor  # [R, K], sums to at most 1; what is missing counts as missed, so that references compare
    group: Tensor  # [R, K], one of GROUPS

    @property
    def on_floor(self) -> Tensor:
        """Which contacts are with the floor rather than the object. -> [R, K]."""
        return self.group == FLOOR

    def __getitem__(self, index: Tensor | slice) -> "Contacts":
        return Contacts(self.joint[index], self.offset[index], self.rest[index], self.weight[index], self.group[index])

    def on(self, figure: Figure) -> Tensor:
        """The contact points of every pose [B, K, 3] [m]."""
        count = len(figure)
        return figure.attached(self.joint.expand(count, -1), self.offset.expand(count, -1, -1))

    def misses(self, height: Tensor, distance: Tensor) -> Tensor:
        """What is between the contact points and what they should touch, from their `height` above the floor and
        their `distance` from the object, both [B, K] [m]. -> [B, K] [m]."""
        return torch.where(self.on_floor, height, distance - self.rest)

    @property
    def width(self) -> Hashable:
        """Number of contacts."""
        return self.joint.shape[1]

    def stacked(self, others: Sequence["Contacts"]) -> "Contacts":
        """With those of `others` below, filled up to the same number with some that weigh nothing."""
        parts = (self, *others)
        most = max(part.joint.shape[1] for part in parts)

        def filled(values: list[Tensor]) -> Tensor:
            return torch.cat([torch.cat([v, v[:, :1].expand(-1, most - v.shape[1], *v.shape[2:])], 1) for v in values])

        weights = [torch.nn.functional.pad(part.weight, (0, most - part.weight.shape[1])) for part in parts]
        return Contacts(
            filled([part.joint for part in parts]),
            filled([part.offset for part in parts]),
            filled([part.rest for part in parts]),
            torch.cat(weights),
            filled([part.group for part in parts]),
        )


def contact(misses: Tensor, weight: Tensor) -> RobustLoss:
    """E_s = 1 - sum_k w_k + sum_k w_k e_k^2 / (e_k^2 + s^2) in [0, 1]; 0 when every kind of contact is there and met.

    `misses` e [B, K] [m], `weight` w [1 or B, K]. The Geman-McClure function lets go of contacts that the target
    cannot offer: a stool has no back.
    """
    found = geman_mcclure(misses, SCALE, weight)
    return RobustLoss(1.0 - weight.sum(-1) + found.energy, found.slope, found.stiffness)


class Contact(Term):
    """The reference's contacts, met or missed."""

    name = "contact"
    symbol = "E_s"
    equation = "1 − Σ_k w_k + Σ_k w_k ρ(d(x_k) − d_k) of the seat, rests and floor that the reference touches"
    weight = 1.0  # a tenth of the contacts missed costs 0.1
    coarse = True

    def prepare(self, reference: ReferenceScene) -> Contacts:
        """The contacts of a reference pair."""
        return reference_contacts(reference)

    def residual(self, scene: Scene) -> RobustLoss:
        """In the misses [B, K] [m]."""
        contacts, (points, distance, _) = contacts_of(scene.model), self.touching(scene)
        misses = contacts.misses(points[..., 1] - scene.target.floor_height, distance)
        return contact(misses, contacts.weight)

    def jacobian(self, scene: Scene) -> Tensor:
        """How the misses move: with the floor upwards, else along the object's normal. [B, K, N]."""
        contacts, (points, _, normal) = contacts_of(scene.model), self.touching(scene)
        direction = torch.where(contacts.on_floor[..., None], _UP, normal)
        return scene.chain.along(contacts.joint.expand(len(points), -1), points, direction)

    def touching(self, scene: Scene) -> tuple[Tensor, Tensor, Tensor]:
        """The contact points [B, K, 3], their distances from the object [B, K] and its normals there [B, K, 3]."""

        def look() -> tuple[Tensor, Tensor, Tensor]:
            points = contacts_of(scene.model).on(scene.figure)
            return (points, *scene.surface(points))

        return scene.once("contacts", look)


def contacts_of(model: ReferenceModel) -> Contacts:
    """The contacts of a model's references."""
    contacts = model.prepared[Contact.name]
    assert isinstance(contacts, Contacts)
    return contacts


def find_contacts(figure: Figure, body: BodyPoints, distance: SignedDistance) -> tuple[Tensor, Tensor, Tensor]:
    """Where the reference body touches the reference object: spheres within `REACH` of its surface.

    Returns the indices of the spheres [K], the outward normals there [K, 3], and the distances of their centres [K].
    """
    value, gradient = distance.tangent(body.on(figure)[0])
    near = torch.nonzero((value - body.radius).abs() < REACH)[:, 0]
    return near, torch.nn.functional.normalize(gradient[near], dim=-1), value[near]


def reference_contacts(reference: ReferenceScene) -> Contacts:
    """Contacts with the object and of the soles with the floor; groups share fixed weights so that none is drowned."""
    figure, body, floor_height = reference.figure, reference.body, reference.floor_height
    near, normal, gap = find_contacts(figure, body, reference.distance)
    names = figure.skeleton.humanoid_bones
    group = [_contact_group(names[int(body.joint[i])], bool(n[1] > UPWARD)) for i, n in zip(near, normal, strict=True)]
    kept = torch.tensor([k for k, g in enumerate(group) if g is not None], dtype=torch.long)
    source, sideways = _widened(body.joint[near[kept]], names)
    kept = kept[source]
    joint, normal = body.joint[near[kept]], normal[kept]
    on_surface = (
        body.on(figure)[0, near[kept]] - gap[kept, None] * normal + sideways[:, None] * figure.axes[0, joint, :, 0]
    )
    # Where the body's surface is when it presses no deeper than it should.
    pressing = (gap[kept] - body.radius[near[kept]] + PRESS).clamp(max=0.0)[:, None] * normal
    soles = _soles(figure, floor_height)
    groups = torch.tensor([group[k] for k in kept] + [FLOOR] * len(soles))
    points = torch.cat([on_surface + pressing, _dropped(figure.positions[0, soles], floor_height)])
    joint = torch.cat([joint, soles])
    weight = torch.tensor(GROUP_WEIGHTS)[groups] / torch.bincount(groups, minlength=len(GROUPS))[groups]
    rest = torch.cat([reference.distance.query(on_surface), torch.zeros(len(soles))])
    return Contacts(joint[None], _in_joint_frame(figure, joint, points)[None], rest[None], weight[None], groups[None])


def _widened(joint: Tensor, names: tuple[str, ...]) -> tuple[Tensor, Tensor]:
    """Every contact of the trunk, whose capsules are thin, as two at the width of the ribs: they hold its heading.

    Returns which contact each comes from, and how far to the side it lies [m].
    """
    sides = [(-RIBS, RIBS) if names[int(j)] in _TRUNK else (0.0,) for j in joint]
    source = torch.tensor([k for k, side in enumerate(sides) for _ in side], dtype=torch.long)
    return source, torch.tensor([x for side in sides for x in side])


def _contact_group(bone: str, upward: bool) -> int | None:
    """What a contact does for the body; None when it does nothing, as a calf that brushes the seat's front."""
    if bone.endswith(_ARMS):
        return ARMS
    if upward:
        return SUPPORT
    return None if bone.endswith(_LEGS) else LEAN


def _soles(figure: Figure, floor_height: float) -> Tensor:
    """Foot and toe joints that stand on the floor."""
    names = figure.skeleton.humanoid_bones
    feet = [
        j
        for j, n in enumerate(names)
        if n.endswith(("Foot", "Toes")) and figure.positions[0, j, 1] - floor_height < GROUNDED
    ]
    return torch.tensor(feet, dtype=torch.long)


def _dropped(points: Tensor, height: float) -> Tensor:
    return torch.stack([points[:, 0], torch.full_like(points[:, 1], height), points[:, 2]], dim=-1)


def _in_joint_frame(figure: Figure, joint: Tensor, points: Tensor) -> Tensor:
    return quat_rotate(quat_inv(figure.orientations[0, joint]), points - figure.positions[0, joint])
