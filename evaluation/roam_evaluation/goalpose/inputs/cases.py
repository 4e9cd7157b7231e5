"""What the solver is given, and what its answer is judged by: an object as it is, or as a careless user sends it."""

import io
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import trimesh
from roam_character.pose import Pose
from roam_character.rotation import quat_from_yaw, quat_rotate
from roam_goalpose.objects import Shape, load_shape
from scipy.spatial.transform import Rotation

from roam_evaluation.goalpose.inputs.objects import EvaluationObject
from roam_evaluation.goalpose.inputs.seat_region import SeatRegion, sample_mesh, seat_region

Array = npt.NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class Case:
    """An object in canonical form, and the upload that stands for it: `given` = `truth` turned, then moved."""

    item: EvaluationObject
    truth: Shape
    region: SeatRegion | None
    given: Shape
    yaw: float = 0.0  # [rad]
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m]

    def brought_back(self, pose: Pose) -> Pose:
        """A pose on the upload as a pose on the canonical object."""
        return pose.moved(-np.array(self.offset)).turned(-self.yaw)


def plain_case(item: EvaluationObject) -> Case:
    """The object as it is. Raises ObjectError."""
    shape = load_shape(item.read(), item.format)
    region = seat_region(*shape.mesh, seat_height=item.seat_height) if shape.mesh else None
    return Case(item, shape, region, shape)


def turned_case(case: Case, seed: int) -> Case:
    """The upload turned about the vertical and moved by up to 3 m, at random."""
    random = np.random.default_rng(seed)
    yaw, offset = float(random.uniform(-math.pi, math.pi)), random.uniform(-3.0, 3.0, 3)
    vertices, faces = _mesh(case)
    given = _uploaded_mesh(_turned(vertices, yaw) + offset, faces, up="y")
    return replace(case, given=given, yaw=yaw, offset=(float(offset[0]), float(offset[1]), float(offset[2])))


def faced_case(case: Case, heading: float) -> Case:
    """The upload turned so that whoever begins at yaw 0 begins at `heading` [rad] to the object."""
    vertices, faces = _mesh(case)
    return replace(case, given=_uploaded_mesh(_turned(vertices, -heading), faces, up="y"), yaw=-heading)


def tumbled_case(case: Case, seed: int) -> Case:
    """The upload as written by a program with Z up, moved and turned at random; up is for the service to find."""
    turned = turned_case(case, seed)
    vertices, faces = _mesh(turned, given=True)
    lying = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=-1)
    return replace(turned, given=_uploaded_mesh(lying, faces, up=None))


def tilted_case(case: Case, seed: int) -> Case:
    """A glTF file in which the object leans by 15 to 45° to a random side; to be set upright by the service."""
    random = np.random.default_rng(seed)
    side = random.uniform(-math.pi, math.pi)
    lean = Rotation.from_rotvec(math.radians(random.uniform(15, 45)) * np.array([math.cos(side), 0.0, math.sin(side)]))
    return _rotated_case(case, lean.as_matrix(), file_type="glb")


def spun_case(case: Case, seed: int) -> Case:
    """A file without an up axis in which the object is rotated at random in all three dimensions."""
    rotation = Rotation.random(random_state=seed).as_matrix()
    return _rotated_case(case, np.asarray(rotation), file_type="ply")


def _rotated_case(case: Case, rotation: Array, *, file_type: str) -> Case:
    """The upload rotated by `rotation` `[3, 3]`. What is not set upright is judged as if it was, and fails."""
    vertices, faces = _mesh(case)
    file = io.BytesIO()
    trimesh.Trimesh(vertices @ rotation.T, faces, process=False).export(file, file_type=file_type)
    given = load_shape(file.getvalue(), file_type, unit="m")
    turn = given.object_to_world[:3, :3] @ rotation
    return replace(case, given=given, yaw=math.atan2(turn[0, 2], turn[2, 2]))


def scaled_case(case: Case, factor: float) -> Case:
    """The object itself larger or smaller: what a wrong unit guess or a careless export leaves of it."""
    vertices, faces = _mesh(case)
    shape = _uploaded_mesh(vertices * factor, faces, up="y")
    height = case.item.seat_height
    item = replace(case.item, seat_height=None if height is None else height * factor)
    region = seat_region(vertices * factor, faces, seat_height=item.seat_height)
    return Case(item, shape, region, shape)


def cloud_case(case: Case, *, count: int, noise: float = 0.0, hidden_from: float | None = None, seed: int = 0) -> Case:
    """The upload is a scan: `count` points with Gaussian `noise` [m], only of what shows from all sides but one.

    `hidden_from` [rad]: the heading of the side that no camera saw; surfaces that face it are missing.
    """
    points, normals = sample_mesh(*_mesh(case), count=max(4 * count, 20_000))
    if hidden_from is not None:
        outward = _outward(points, normals, case.truth)
        away = outward @ np.array([math.sin(hidden_from), 0.0, math.cos(hidden_from)]) > 0.5
        points = points[~away]
    random = np.random.default_rng(seed)
    points = points[random.permutation(len(points))[:count]]
    file = io.BytesIO()
    np.save(file, (points + random.normal(0.0, noise, points.shape)).astype(np.float32))
    return replace(case, given=load_shape(file.getvalue(), "npy", unit="m", up="y"))


def _outward(points: Array, normals: Array, shape: Shape) -> Array:
    """Normals turned to the side where the distance to the object grows. [N, 3]."""
    grows = shape.distance.sample(points + 0.02 * normals) - shape.distance.sample(points - 0.02 * normals)
    return normals * np.where(grows >= 0, 1.0, -1.0)[:, None]


def _mesh(case: Case, *, given: bool = False) -> tuple[Array, npt.NDArray[np.integer]]:
    mesh = (case.given if given else case.truth).mesh
    if mesh is None:
        raise ValueError(f"{case.item.name} is a bare cloud; only meshes can be distorted")
    return mesh[0].astype(np.float64), mesh[1]


def _turned(vertices: Array, yaw: float) -> Array:
    turn = np.broadcast_to(quat_from_yaw(np.array(yaw)), (len(vertices), 4))
    return np.asarray(quat_rotate(turn, vertices))


def _uploaded_mesh(vertices: Array, faces: npt.NDArray[np.integer], *, up: str | None) -> Shape:
    file = io.BytesIO()
    trimesh.Trimesh(vertices, faces, process=False).export(file, file_type="ply")
    return load_shape(file.getvalue(), "ply", unit="m", up=up)
