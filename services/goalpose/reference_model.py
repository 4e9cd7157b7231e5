"""Turns a reference pair into what the energy compares with: descriptors, contacts, allowances, canonical pose."""

import torch
from character.body import body_capsules
from character.pose import rest_pose
from character.rotation import quat_inv, quat_rotate
from torch import Tensor

from goalpose.energy.angle_limit import load_limits
from goalpose.energy.clearance import clearances
from goalpose.energy.contact import Contacts, find_contacts
from goalpose.energy.descriptor import DescriptorField, make_probes, pose_descriptor
from goalpose.energy.facing import front_seen_by_pelvis
from goalpose.energy.figure import Figure, figure_from_pose
from goalpose.energy.gravity import gravity_directions
from goalpose.energy.penetration import BodyPoints, body_points, penetration_depths
from goalpose.energy.prior import canonical_positions
from goalpose.energy.pull import SignedDistance
from goalpose.energy.self_collision import collision_pairs, pair_depths
from goalpose.energy.symmetry import mirrored_pairs
from goalpose.energy.total import ReferenceModel
from goalpose.objects import DistanceGrid
from goalpose.references import ReferencePair

GIVE = 0.012  # [m] how much flesh and cushion give everywhere
NEAR = 0.15  # [m] from the object at which a descriptor counts half
RIBS = 0.10  # [m] from the spine to the side of the back
GROUP_WEIGHTS = {"support": 0.4, "lean": 0.3, "floor": 0.2, "arms": 0.1}
_ARMS = ("UpperArm", "LowerArm", "Hand")
_TRUNK = ("spine", "chest", "upperChest")
_LEGS = ("UpperLeg", "LowerLeg", "Foot", "Toes")


def model_reference(
    pair: ReferencePair, field: DescriptorField, *, samples: int, seed: int = 0, points: int = 1500
) -> ReferenceModel:
    """All that the energy needs of a reference pair; `samples` probes per centre, `points` for the encoder."""
    skeleton = pair.pose.skeleton
    figure = figure_of(pair)
    probes = make_probes(skeleton, samples=samples, seed=seed)
    body = body_points(body_capsules(skeleton))
    rest = rest_pose(skeleton)
    standing = figure_from_pose(
        skeleton, torch.as_tensor(rest.root_position)[None], torch.as_tensor(rest.rotations)[None]
    )
    pairs = collision_pairs(skeleton, body, standing)
    with torch.no_grad():
        latent = field.encode(torch.as_tensor(pair.shape.points[:points])[None])
        descriptors = pose_descriptor(field, latent, figure, probes)[0]
        apart = pair.shape.distance.query(figure.attached(probes.joint, probes.offset))[0]
        room = clearances(figure, body, pair.shape.distance)[0]
        overlap = penetration_depths(figure, body, pair.shape.distance)[0]
    return ReferenceModel(
        skeleton=skeleton,
        figure=figure,
        canonical=canonical_positions(figure)[0],
        gravity=gravity_directions(figure)[0],
        front=front_seen_by_pelvis(figure, field.front(latent)[0]),
        probes=probes,
        descriptors=descriptors,
        nearness=1.0 / (1.0 + (apart.clamp(min=0.0) / NEAR).square()),
        body=body,
        allowance=torch.maximum(overlap, torch.tensor(GIVE)),
        contacts=reference_contacts(figure, body, pair.shape.distance, pair.shape.floor_height),
        collision_pairs=pairs,
        collision_allowance=pair_depths(figure, body, pairs)[0].clamp(min=0.0) + GIVE,
        limits=load_limits(skeleton),
        clearances=room,
        mirrored=mirrored_pairs(skeleton, body),
        hip_height=height_above_surface(pair.shape.distance, figure.root_position[0]),
        floor_height=pair.shape.floor_height,
    )


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
    near, touching = find_contacts(figure, body, distance)
    names = figure.skeleton.humanoid_bones
    spheres = figure.attached(body.joint, body.offset)[0][near]
    upward = torch.nn.functional.normalize(spheres - touching, dim=-1)[:, 1] > 0.7
    groups = [_contact_group(names[int(body.joint[i])], bool(up)) for i, up in zip(near, upward, strict=True)]
    kept = torch.tensor([k for k, group in enumerate(groups) if group], dtype=torch.long)
    near, touching, groups = near[kept], touching[kept], [group for group in groups if group]
    joint = body.joint[near]
    offset = _in_joint_frame(figure, joint, touching)
    joint, offset, groups = _widened(joint, offset, groups, names)
    soles = _soles(figure, floor_height)
    joint = torch.cat([joint, soles])
    offset = torch.cat([offset, _in_joint_frame(figure, soles, _dropped(figure.positions[0, soles], floor_height))])
    groups += ["floor"] * len(soles)
    on_floor = torch.tensor([group == "floor" for group in groups])
    rest = torch.where(on_floor, 0.0, distance.query(figure.attached(joint, offset))[0])
    weight = torch.tensor([GROUP_WEIGHTS[g] / groups.count(g) for g in groups])
    return Contacts(joint, offset, rest, weight, on_floor, tuple(groups))


def _widened(
    joint: Tensor, offset: Tensor, groups: list[str], names: tuple[str, ...]
) -> tuple[Tensor, Tensor, list[str]]:
    """Every contact of the trunk, whose capsules are thin, as two at the width of the ribs: they hold its heading."""
    wide = [names[int(j)] in _TRUNK for j in joint]
    count = torch.tensor([2 if w else 1 for w in wide])
    side = torch.cat([torch.tensor([-RIBS, RIBS] if w else [0.0]) for w in wide]) if wide else torch.zeros(0)
    moved = offset.repeat_interleave(count, 0) + side[:, None] * torch.tensor([1.0, 0.0, 0.0])
    return joint.repeat_interleave(count), moved, [g for g, w in zip(groups, wide, strict=True) for _ in range(1 + w)]


def _contact_group(bone: str, upward: bool) -> str:
    """What a contact does for the body; "" when it does nothing, as a calf that brushes the seat's front."""
    if bone.endswith(_ARMS):
        return "arms"
    if upward:
        return "support"
    return "" if bone.endswith(_LEGS) else "lean"


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
