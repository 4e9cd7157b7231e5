"""What the solver tests share: a field without training, a reference pair, and its model."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from roam_goalpose.energy.constraints import NONE, Constraints
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.scene import Target
from roam_goalpose.references.model import model_reference, study_pair
from roam_goalpose.references.pairs import ReferencePair, load_reference
from torch import Tensor

REFERENCES = Path(__file__).parents[2] / "examples" / "references"


@dataclass
class Autograd:
    """Descriptors with the slopes that autograd finds."""

    queries: Tensor
    descriptors: Tensor

    def vjp(self, cotangent: Tensor) -> Tensor:
        with torch.inference_mode(False):
            (slope,) = torch.autograd.grad(self.descriptors, self.queries, cotangent.clone())
        return slope


class LandmarkField:
    """Descriptors from distances to the object's extreme points: smooth, and invariant under turns about +Y."""

    def encode(self, points: Tensor) -> Tensor:
        """Means of the cloud's height layers and its middle. [1, N, 3] -> [1, 5, 3]."""
        cloud = points[0]
        order = cloud[:, 1].argsort()
        layers = [layer.mean(0) for layer in cloud[order].chunk(4)]
        return torch.stack([*layers, cloud.mean(0)])[None]

    def descriptor(self, latent: Tensor, x: Tensor) -> Tensor:
        """[1, Q, 3] -> [1, Q, 10]."""
        distance = (x[:, :, None] - latent[:, None]).square().sum(-1).add(1e-4).sqrt()
        return torch.nn.functional.normalize(torch.cat([distance.sin(), distance.cos()], -1), dim=-1)

    def linearize(self, latent: Tensor, x: Tensor) -> Autograd:
        """The same with its slopes."""
        with torch.inference_mode(False), torch.enable_grad():
            leaf = x.clone().detach().requires_grad_()
            return Autograd(leaf, self.descriptor(latent.clone(), leaf))


@cache
def pair(name: str) -> ReferencePair:
    """A shipped reference pair."""
    return load_reference(REFERENCES / f"{name}.json")


@cache
def model(name: str, samples: int = 2) -> ReferenceModel:
    """Its model under the landmark field."""
    field = LandmarkField()
    return model_reference(study_pair(pair(name), field), samples=samples)


def target_of(name: str, wishes: Constraints | None = None) -> Target:
    """The object of a reference pair as something to pose on."""
    field, shape = LandmarkField(), pair(name).shape
    latent = field.encode(torch.as_tensor(shape.points[:1500])[None])
    front = torch.tensor(shape.front, dtype=torch.float32)
    return Target(field, latent, shape.distance, shape.floor_height, front, wishes or NONE)
