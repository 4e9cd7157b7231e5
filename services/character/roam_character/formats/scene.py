"""What a file is written from: a pose or a motion, on whose body, beside which piece of furniture."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from roam_character.clip import Clip
from roam_character.documents.gltf_document import GltfDocument
from roam_character.pose import Pose

if TYPE_CHECKING:
    from roam_character.retargeting.onto_rig import RigMotion


@dataclass(frozen=True, eq=False)
class Furniture:
    """An object beside the character, as the file that it came in has it."""

    document: GltfDocument  # meshes, materials, hierarchy; clouds as points
    to_world: np.ndarray  # [4, 4] from the document's space to the character's [m]
    name: str = "object"


@dataclass(frozen=True, eq=False)
class Scene:
    """A pose (one frame) or a motion, and what stands beside it."""

    content: Clip | Pose  # of our skeleton, or of one of a character's proportions
    character: "RigMotion | None" = None  # the same on the user's own character
    furniture: Furniture | None = None
    arrays: Mapping[str, Any] = field(default_factory=dict)  # what .npz, .json and .csv hold beside the joints
    extra: Mapping[str, Any] = field(default_factory=dict)  # names and marks for .json
    name: str = "motion"

    @property
    def is_pose(self) -> bool:
        """Whether it is a single still pose."""
        return isinstance(self.content, Pose)

    @property
    def clip(self) -> Clip:
        """The content as frames; a pose is one frame."""
        if isinstance(self.content, Clip):
            return self.content
        return Clip(self.content.skeleton, 30.0, self.content.root_position[None], self.content.rotations[None])
