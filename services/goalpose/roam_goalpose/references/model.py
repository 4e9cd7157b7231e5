"""Turns a reference pair into what the energy compares with: descriptors, contacts, allowances, canonical pose."""

from dataclasses import dataclass
from typing import Any

import torch
from roam_character.body import body_capsules
from roam_character.pose import rest_pose
from roam_character.rotation import quat_inv, quat_rotate
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.angle_limit import load_limits
from roam_goalpose.energy.clearance import FAR
from roam_goalpose.energy.contact import ARMS, FLOOR, GROUPS, LEAN, SUPPORT, Contacts, find_contacts
from roam_goalpose.energy.descriptor import DescriptorField, make_probes, pose_descriptor
from roam_goalpose.energy.distance import SignedDistance
from roam_goalpose.energy.facing import front_seen_by_pelvis
from roam_goalpose.energy.figure import Figure, figure_from_pose
from roam_goalpose.energy.gravity import gravity_directions
from roam_goalpose.energy.penetration import BodyPoints, body_points
from roam_goalpose.energy.prior import canonical_positions
from roam_goalpose.energy.self_collision import collision_pairs, pair_depths
from roam_goalpose.energy.symmetry import mirrored_pairs
from roam_goalpose.energy.total import ReferenceModel
from roam_goalpose.objects import DistanceGrid
from roam_goalpose.references.pairs import ReferencePair

GIVE = 0.012  # [m] how much flesh and cushion give everywhere
PRESS = 0.015  # [m] deepest that a reference person's pressing into the furniture is taken for meant
NEAR = 0.15  # [m] from the object at which a descriptor counts half
UPWARD = 0.7  # cosine of the steepest surface that holds a body from below
RIBS = 0.10  # [m] from the spine to the side of the back
GROUP_WEIGHTS = (0.35, 0.25, 0.3, 0.1)  # support, lean, floor, arms
_ARMS = ("UpperArm", "LowerArm", "Hand")
_TRUNK = ("spine", "chest", "upperChest")
_LEGS = ("UpperLeg", "LowerLeg", "Foot", "Toes")


@dataclass(frozen=True, eq=False)
class StudiedPair:
    """What is known of a reference pair whatever the probes are."""

    pair: ReferencePair
    figure: Figure
    latent: Any  # of the object
    parts: dict[str, Any]  # of the model, by name


def study_pair(pair: ReferencePair, field: DescriptorField, *, points: int = 1500) -> StudiedPair:
    """Looks at one reference pair, with `points` of its surface for the encoder."""
    skeleton, figure = pair.pose.skeleton, figure_of(pair)
    body = body_points(body_capsules(skeleton))
    pairs = collision_pairs(skeleton, body, _standing(skeleton))
    distance, floor_height = pair.shape.distance, pair.shape.floor_height
    with torch.no_grad():
        latent = field.encode(torch.as_tensor(pair.shape.points[:points])[None])
        room = torch.maximum(distance.query(body.on(figure)), body.radius - PRESS).clamp(max=FAR)
        parts = {
            "body": body,
            "mirrored": mirrored_pairs(skeleton, body),
            "collision_pairs": pairs,
            "canonical": canonical_positions(figure),
            "gravity": gravity_directions(figure),
            "front": front_seen_by_pelvis(figure, torch.tensor(pair.shape.front, dtype=torch.float32))[None],
            "allowance": (body.radius - room).clamp(min=GIVE),
            "contacts": reference_contacts(figure, body, distance, floor_height),
            "clearances": room,
            "collision_allowances": pair_depths(body.on(figure), body, pairs).clamp(min=0.0) + GIVE,
            "hip_height": torch.tensor([height_above_surface(distance, figure.root_position[0])]),
        }
    return StudiedPair(pair, figure, latent, parts)


def model_reference(studied: StudiedPair, field: DescriptorField, *, samples: int, seed: int = 0) -> ReferenceModel:
    """What the energy needs of one reference pair (R = 1), with `samples` probes per centre."""
    shape, figure = studied.pair.shape, studied.figure
    probes = make_probes(figure.skeleton, samples=samples, seed=seed)
    with torch.no_grad():
        apart = shape.distance.query(figure.attached(probes.joint, probes.offset))
        return ReferenceModel(
            skeleton=figure.skeleton,
            probes=probes,
            limits=load_limits(figure.skeleton),
            figure=figure,
            descriptors=pose_descriptor(field, studied.latent, figure, probes),
            row=torch.zeros(1, dtype=torch.long),
            nearness=1.0 / (1.0 + (apart.clamp(min=0.0) / NEAR).square()),
            floor_height=torch.tensor([shape.floor_height]),
            **studied.parts,
        )


def _standing(skeleton: Skeleton) -> Figure:
    """The rest pose."""
    rest = rest_pose(skeleton)
    return figure_from_pose(skeleton, torch.as_tensor(rest.root_position)[None], torch.as_tensor(rest.rotations)[None])


def figure_of(pair: ReferencePair) -> Figure:
    """The reference pose as a batch of one."""
    pose = pair.pose
    return figure_from_pose(
        pose.skeleton, torch.as_tensor(pose.root_position)[None], torch.as_tensor(pose.rotations)[None]
    )


def height_above_surface(distance: SignedDistance, point: Tensor, *, reach: float = 0.6) -> float:
    """Height [m] of a point above the first surface straight below it, `reach` when there is none."""
    drops = torch.arange(0.0, reach, 0.004)
    column = point + torch.stack([0 * drops, -drops, 0 * drops], dim=-1)
    inside = torch.nonzero(distance.query(column) <= 0)
    return float(drops[inside[0, 0]]) if len(inside) else reach


def reference_contacts(figure: Figure, body: BodyPoints, distance: DistanceGrid, floor_height: float) -> Contacts:
    """Contacts with the object and of the soles with the floor; groups share fixed weights so that none is drowned."""
    near, normal, gap = find_contacts(figure, body, distance)
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
    rest = torch.cat([distance.query(on_surface), torch.zeros(len(soles))])
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
        if n.endswith(("Foot", "Toes")) and figure.positions[0, j, 1] - floor_height < 0.12
    ]
    return torch.tensor(feet, dtype=torch.long)


def _dropped(points: Tensor, height: float) -> Tensor:
    return torch.stack([points[:, 0], torch.full_like(points[:, 1], height), points[:, 2]], dim=-1)


def _in_joint_frame(figure: Figure, joint: Tensor, points: Tensor) -> Tensor:
    return quat_rotate(quat_inv(figure.orientations[0, joint]), points - figure.positions[0, joint])
