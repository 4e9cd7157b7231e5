"""Turns a reference pair into what the energy compares with: whatever every term of the registry prepares."""

from dataclasses import dataclass, replace

import torch
from roam_character.body import body_capsules
from torch import Tensor

from roam_goalpose.energy.body import body_points
from roam_goalpose.energy.figure import Figure, figure_from_pose
from roam_goalpose.energy.object import DescriptorField, SignedDistance
from roam_goalpose.energy.probes import make_probes
from roam_goalpose.energy.reference import Prepared, ReferenceModel, ReferenceScene
from roam_goalpose.energy.terms import TERMS
from roam_goalpose.references.pairs import ReferencePair


@dataclass(frozen=True, eq=False)
class StudiedPair:
    """What is known of a reference pair whatever the probes are."""

    scene: ReferenceScene
    hip_height: float  # of the hips joint above the surface below it [m]
    prepared: dict[str, Prepared]  # by the terms that no probes change


def study_pair(pair: ReferencePair, field: DescriptorField, *, points: int = 1500) -> StudiedPair:
    """Looks at one reference pair, with `points` of its surface for the encoder."""
    figure, shape = figure_of(pair), pair.shape
    with torch.no_grad():
        scene = ReferenceScene(
            figure=figure,
            body=body_points(body_capsules(figure.skeleton)),
            distance=shape.distance,
            floor_height=shape.floor_height,
            front=torch.tensor(shape.front, dtype=torch.float32),
            field=field,
            latent=field.encode(torch.as_tensor(shape.points[:points])[None]),
        )
        height = height_above_surface(shape.distance, figure.root_position[0])
        return StudiedPair(scene, height, _prepared(scene, probed=False))


def model_reference(studied: StudiedPair, *, samples: int, seed: int = 0) -> ReferenceModel:
    """What the energy needs of one reference pair (R = 1), with `samples` probes per centre."""
    scene = studied.scene
    probed = replace(scene, probes=make_probes(scene.skeleton, samples=samples, seed=seed))
    with torch.no_grad():
        found = studied.prepared | _prepared(probed, probed=True)
    return ReferenceModel(
        skeleton=scene.skeleton,
        body=scene.body,
        figure=scene.figure,
        hip_height=torch.tensor([studied.hip_height]),
        floor_height=torch.tensor([scene.floor_height]),
        prepared={name: found[name] for name in TERMS if name in found},
    )


def _prepared(scene: ReferenceScene, *, probed: bool) -> dict[str, Prepared]:
    made = {term.name: term.prepare(scene) for term in TERMS.values() if term.probed == probed}
    return {name: part for name, part in made.items() if part is not None}


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
