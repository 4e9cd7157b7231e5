"""A humanoid of capsules on an object, let go under gravity: does the pose hold itself? (paper, section D)

The joints are held by springs towards the pose, as a sitting person holds themselves; nothing holds the root. The
body collides with the object and the floor, not with itself. Needs MuJoCo, an optional extra: `evaluation`.
"""

from dataclasses import dataclass
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
import numpy.typing as npt
from roam_character.body import Capsules, body_capsules
from roam_character.pose import Pose
from roam_goalpose.objects import Shape

from roam_evaluation.goalpose.simulation.solid_boxes import Boxes, solid_boxes

Array = npt.NDArray[np.floating]

RATE = 240  # [1/s] steps
MASS = 65.0  # [kg] of the person, shared among the capsules by volume
SAG = 0.05  # [rad] by which a joint's spring gives under the weight of all that hangs on it
GRAVITY = 9.81  # [m/s^2]
FRICTION = "0.8 0.005 0.0001"
# Flesh and upholstery: contacts are soft over the first two centimetres.
SOFTNESS = {"solref": "0.03 1", "solimp": "0.3 0.95 0.02"}

# What MuJoCo says of positions, velocities or accelerations that are not numbers, or beyond 1e10.
_UNSTABLE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


@dataclass(frozen=True, eq=False)
class Drift:
    """How far every joint was from its place after the simulation."""

    joints: Array  # [J] [m]
    boxes: int  # that the object was made of

    @property
    def mean(self) -> float:
        """Over the joints [m]."""
        return float(self.joints.mean())

    @property
    def largest(self) -> float:
        """Of any joint [m]."""
        return float(self.joints.max())


def drift(pose: Pose, shape: Shape, *, seconds: float = 1.0) -> Drift:
    """Lets the pose go on the object for `seconds` [s]; an unstable simulation counts as infinitely far."""
    capsules = body_capsules(pose.skeleton)
    starts, ends = capsules.segments(*pose.posture())
    boxes = solid_boxes(shape, np.concatenate([starts, ends]))
    model = mujoco.MjModel.from_xml_string(scene_xml(pose, capsules, boxes, shape.floor_height))
    return Drift(settled(model, round(seconds * RATE)), len(boxes.half))


def settled(model: mujoco.MjModel, steps: int) -> Array:
    """How far every body of a model but the world is from its start after some steps [J] [m]; infinitely far where
    the simulation exploded.

    MuJoCo makes nothing of an explosion: it warns, puts the simulation back to its start and goes on from there, so
    that all bodies end near their places. Auto-reset is off here, and its warnings count.
    """
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    before = data.xpos[1:].copy()
    for _ in range(steps):
        mujoco.mj_step(model, data)
        if any(data.warning[kind].number for kind in _UNSTABLE):
            return np.full(len(before), np.inf)
    assert np.isclose(data.time, steps * model.opt.timestep), "MuJoCo has put the simulation back to its start"
    moved = np.linalg.norm(data.xpos[1:] - before, axis=-1)
    return np.asarray(np.nan_to_num(moved, nan=np.inf))


def scene_xml(pose: Pose, capsules: Capsules, boxes: Boxes, floor_height: float) -> str:
    """The scene in MuJoCo's format: bodies in joint order, so that body k + 1 is joint k."""
    root = Xml.Element("mujoco")
    option = {"timestep": str(1 / RATE), "gravity": f"0 {-GRAVITY} 0", "integrator": "implicitfast"}
    Xml.SubElement(root, "option", option)
    default = Xml.SubElement(root, "default")
    Xml.SubElement(default, "geom", {"friction": FRICTION, **SOFTNESS})
    world = Xml.SubElement(root, "worldbody")
    floor = {"type": "plane", "size": "0 0 1", "pos": f"0 {floor_height} 0", "zaxis": "0 1 0"}
    solid = {"contype": "2", "conaffinity": "1"}
    Xml.SubElement(world, "geom", floor | solid)
    for center, half in zip(boxes.centers, boxes.half, strict=True):
        Xml.SubElement(world, "geom", {"type": "box", "pos": _text(center), "size": _text(half)} | solid)
    _add_body(world, pose, capsules)
    return Xml.tostring(root, encoding="unicode")


def _add_body(world: Xml.Element, pose: Pose, capsules: Capsules) -> None:
    skeleton = pose.skeleton
    masses = _masses(capsules)
    loads = _loads(pose, capsules, masses)
    bodies: list[Xml.Element] = []
    for j, parent in enumerate(skeleton.parents):
        above = world if parent < 0 else bodies[parent]
        place = pose.root_position if parent < 0 else skeleton.rest_offsets[j]
        x, y, z, w = pose.rotations[j]
        body = Xml.SubElement(above, "body", name=skeleton.joint_names[j], pos=_text(place), quat=_text([w, x, y, z]))
        bodies.append(body)
        if parent < 0:
            Xml.SubElement(body, "freejoint")
        else:
            mass, arm = loads[j]
            stiffness = mass * GRAVITY * arm / SAG
            damping = 2 * np.sqrt(stiffness * mass) * arm  # critical for a mass at the end of the arm
            Xml.SubElement(body, "joint", type="ball", stiffness=f"{stiffness:.4f}", damping=f"{damping:.4f}")
        for c in np.flatnonzero(capsules.joints == j):
            line = _text([*capsules.starts[c], *capsules.ends[c]])
            form = {"type": "capsule", "fromto": line, "size": str(capsules.radii[c]), "mass": f"{masses[c]:.4f}"}
            Xml.SubElement(body, "geom", form | {"contype": "1", "conaffinity": "2"})


def _masses(capsules: Capsules) -> Array:
    """Of every capsule [C] [kg]."""
    lengths = np.linalg.norm(capsules.ends - capsules.starts, axis=-1)
    volumes = np.pi * capsules.radii**2 * (lengths + 4 / 3 * capsules.radii)
    return MASS * volumes / volumes.sum()


def _loads(pose: Pose, capsules: Capsules, masses: Array) -> list[tuple[float, float]]:
    """Mass [kg] that hangs on every joint, and how far from the joint its middle is [m] (at least 3 cm)."""
    parents, positions = pose.skeleton.parents, pose.positions()
    starts, ends = capsules.segments(*pose.posture())
    middles = np.asarray(starts + ends) / 2
    found = []
    for j, position in enumerate(positions):
        hanging = np.array([_hangs_on(parents, int(joint), j) for joint in capsules.joints])
        mass = float(masses[hanging].sum())
        middle = np.average(middles[hanging], axis=0, weights=masses[hanging]) if mass else position
        found.append((max(mass, 0.1), max(float(np.linalg.norm(middle - position)), 0.03)))
    return found


def _hangs_on(parents: tuple[int, ...], joint: int, ancestor: int) -> bool:
    while joint > ancestor:
        joint = parents[joint]
    return joint == ancestor


def _text(values: npt.ArrayLike) -> str:
    return " ".join(f"{value:.6f}" for value in np.asarray(values, np.float64))
