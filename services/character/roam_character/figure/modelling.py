"""The stance in which the figure is modelled, and solids of a bone carried into it.

Linear skinning keeps the shape of the stance that it was bound in and squeezes joints that are bent far from it. The
figure is modelled half way between its uses: arms lowered, hips and knees a little bent; then it is brought to the
T-pose.
"""

from dataclasses import dataclass

import numpy as np

from roam_character.figure.solids import Solid
from roam_character.kinematics import forward_kinematics
from roam_character.mesh import rest_origins
from roam_character.rotation import quat_from_rotvec, quat_mul, quat_to_matrix
from roam_character.skeleton import Skeleton

# Rotations of the left side [degrees] about x, y, z, applied in this order; the right side is the mirror image.
_STANCE = {
    "UpperArm": ((0, 0, -48), (0, -8, 0)),
    "LowerArm": ((0, -18, 0),),
    "UpperLeg": ((-22, 0, 0), (0, 0, 6)),
    "LowerLeg": ((26, 0, 0),),
    "Foot": ((-4, 0, 0),),
}


@dataclass(frozen=True, eq=False)
class Stance:
    """Where the joints of our skeleton are: `turns` [J, 3, 3] and `places` [J, 3] [m]; `origins` in the T-pose."""

    skeleton: Skeleton
    turns: np.ndarray
    places: np.ndarray
    origins: np.ndarray

    def carried(self, bone: str, solid: Solid) -> Solid:
        """A solid given in the T-pose, moved as the bone is."""
        joint = self.skeleton.humanoid_bones.index(bone)
        turn, place, origin = self.turns[joint], self.places[joint], self.origins[joint]
        return lambda points: solid((points - place) @ turn + origin)

    def to_t_pose(self, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Skinned points [V, 3] of the stance → the T-pose points that the weights [V, J] bring there."""
        turn = np.einsum("vj,jab->vab", weights, self.turns)
        shift = weights @ (self.places - np.einsum("jab,jb->ja", self.turns, self.origins))
        return np.linalg.solve(turn, (points - shift)[..., None])[..., 0]


def modelling_stance(skeleton: Skeleton) -> Stance:
    """The stance of our humanoid skeleton, hips where they are at rest."""
    rotations = np.tile(np.array([0.0, 0, 0, 1]), (skeleton.joint_count, 1))
    for joint, bone in enumerate(skeleton.humanoid_bones):
        side = -1.0 if bone.startswith("right") else 1.0
        for about in _STANCE.get(bone.removeprefix("left").removeprefix("right"), ()):
            vector = np.radians(about) * np.array([1.0, side, side])
            rotations[joint] = quat_mul(quat_from_rotvec(vector), rotations[joint])
    places, turns = forward_kinematics(skeleton, np.asarray(skeleton.rest_offsets[0], float), rotations)
    return Stance(skeleton, np.asarray(quat_to_matrix(turns)), np.asarray(places), rest_origins(skeleton))
