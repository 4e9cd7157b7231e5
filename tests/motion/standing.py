"""A network of random weights, a standing character and a seated goal pose, for the tests of the motion domain."""

from dataclasses import dataclass

import numpy as np
import torch
from roam_character.pose import Pose, rest_pose
from roam_character.rotation import quat_from_rotvec, quat_to_matrix
from roam_character.skeleton import humanoid_skeleton
from roam_motion.actions import STYLES
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.prediction import Goals
from roam_motion.animator import Animator
from roam_motion.control.controller import Body, Control, GoalRows, control
from roam_motion.control.intent import Intent
from roam_motion.models.lnsm.config import network_config
from roam_motion.models.lnsm.network import MotionNetwork, Normaliser
from roam_motion.models.lnsm.predict import LnsmModel


def random_animator(seed: int = 0) -> Animator:
    """Small random weights: motion without meaning, but through all the code."""
    return Animator(random_model(seed))


def random_model(seed: int = 0) -> LnsmModel:
    """A network of random weights."""
    torch.manual_seed(seed)
    figure = humanoid_figure()
    config = network_config(figure.joint_count, experts=3, encoding=16, hidden=16)
    normaliser = Normaliser(config)
    normaliser.get_buffer("output_std").fill_(0.01)
    starts = {"height": torch.tensor([0.96]), "orientations": torch.eye(3).expand(1, figure.joint_count, 3, 3).clone()}
    return LnsmModel(figure, MotionNetwork(config), normaliser, starts)


def seated_pose(seat: float = 0.45, ahead: float = 0.0) -> Pose:
    """Thighs level, shins upright, feet flat; hips over (0, 0), facing +Z."""
    skeleton = humanoid_skeleton()
    rotations = rest_pose(skeleton).rotations.copy()
    bend = quat_from_rotvec(np.array([-np.pi / 2, 0, 0], np.float32))
    for side in ("left", "right"):
        rotations[skeleton.index(f"{side}UpperLeg")] = bend
        rotations[skeleton.index(f"{side}LowerLeg")] = bend * np.array([-1, -1, -1, 1], np.float32)
        arm = np.array([0, 0, -1.2 if side == "left" else 1.2], np.float32)
        rotations[skeleton.index(f"{side}UpperArm")] = quat_from_rotvec(arm)
    return Pose(skeleton, np.array([0, seat + 0.11, ahead], np.float32), rotations)


def goals_at(pose: Pose, action: int, *, active: bool) -> Goals:
    """Network goals of one character that all point at a pose's root."""
    figure = humanoid_figure()
    orientations = figure.world(quat_to_matrix(torch.tensor(pose.rotations)))[None]
    positions = figure.positions(torch.tensor(pose.root_position)[None], orientations)
    frame = figure.frame(positions)
    return Goals(
        positions=frame.origin[:, None].expand(-1, 13, -1),
        directions=frame.direction[:, None].expand(-1, 13, -1),
        action=torch.nn.functional.one_hot(torch.tensor([action]), 4).float(),
        active=torch.tensor([float(active)]),
        pose_positions=positions,
        pose_orientations=orientations,
        feet=torch.zeros(1, 2, 4),
        urgency=torch.zeros(1),
    )


@dataclass(frozen=True)
class Asked:
    """The motion model's goals of one character."""

    places: np.ndarray  # [13, 2]
    style: str
    active: bool
    urgency: float
    pose: np.ndarray  # [J, 3] of the goal pose


def controlled(state: Control, intent: Intent, body: Body) -> tuple[Control, Asked]:
    """One frame of the controller for one character."""
    (state,), goals = control(humanoid_figure(), [state], [intent], [body])
    return state, asked(goals, 0)


def asked(goals: GoalRows, row: int) -> Asked:
    """What one row says."""
    fields = {name: field[row] for name, field in goals.fields.items()}
    style = STYLES[int(fields["action"].argmax())]
    urgency, pose = float(fields["urgency"]), fields["pose_positions"].copy()
    return Asked(fields["positions"].copy(), style, bool(fields["active"]), urgency, pose)


def played(animator, states, intents, frames=6):
    shown = []
    for _ in range(frames):
        pairs = animator.step(states, intents)
        states = [state for state, _ in pairs]
        shown.append([frame for _, frame in pairs])
    return states, shown
