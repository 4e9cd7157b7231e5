"""One frame of B characters: encode, predict, blend, plant the feet, shift the series.

Training roll-outs call `advance`; the service traces its three parts as graphs (see graphs.py), to the same numbers up
to rounding. So training sees what runs.
"""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from roam_motion.actions import CARRIED, LIE, STYLES
from roam_motion.animation.blending import WHOLE, Blending, blend_pose, blend_trajectory, blend_weights, limit_turns
from roam_motion.animation.collision import Furniture, keep_clear
from roam_motion.animation.figure import Figure, Frame
from roam_motion.animation.foot_contacts import plant
from roam_motion.animation.prediction import Goals, Predict, Prediction, goal_frame
from roam_motion.animation.proportions import size
from roam_motion.animation.state import FRAME_RATE, LABELLED, PHASE, STYLE, Characters
from roam_motion.animation.stepping import Steps, halted, step

_HANGING = 0.105  # [m], for legs of 0.82 m: an ankle higher than this does not stand on the floor
_COMMITTED = 0.3  # blending weight from which feet go where the goal pose has them
# Style labels that count as taking a goal pose; whatever else the goal's own action shows counts as well.
_CARRIED = torch.tensor([float(style in CARRIED) for style in STYLES])
_HURRY = 1.15  # times as fast as else bones may turn out of furniture
_MOST_PHASE = 0.08  # [turns] per frame: 2.4 gait cycles a second


@dataclass(frozen=True, eq=False)
class Proposal:
    """What network and blending want of the next frame, before furniture and floor have their say."""

    before: Tensor  # [B, J, 3] the joints shown last [m]
    wanted: Tensor  # [B, J, 3] joints [m]
    orientations: Tensor  # [B, J, 3, 3] in the world
    contacts: Tensor  # [B, 4] predicted contact, 0..1
    floor: Tensor  # [B, 4] 1 where a contact belongs on the floor
    styles: Tensor  # [B, 4] idle, walk, sit, lie
    phase: Tensor  # [B, 1] gait phase, counted on [turns]
    future: Tensor  # [B, 6, 9] future keys in the world
    seated: Tensor  # [B] the bidirectional weight
    settled: Tensor  # [B] see `Characters`
    standing: Tensor  # [B] and the rest of `Steps`
    progress: Tensor  # [B, 2]
    share: Tensor  # [B, 2]
    stays: Tensor  # [B, 2]
    landed: Tensor  # [B, 2]

    @property
    def steps(self) -> Steps:
        """What the rule for who stands wants of the feet."""
        return Steps(self.standing, self.progress, self.share, self.stays, self.landed)


def advance(
    figure: Figure,
    predict: Predict,
    characters: Characters,
    goals: Goals,
    parts: Blending = WHOLE,
    around: tuple[Tensor, Furniture] | None = None,
) -> tuple[Characters, Tensor, Tensor]:
    """The next frame of every character; `around` has the furniture of those rows [N] that are near some.

    Returns the new characters, their joint positions [B, J, 3] [m], and the mean joint distance to the goal pose [B]
    [m] (meaningful where the goal is active).
    """
    proposal = propose(figure, predict, characters, goals, parts)
    moved, after = settle(figure, characters, *cleared(figure, characters, goals, proposal, around))
    return moved, after, (after - goals.pose_positions).norm(dim=-1).mean(-1)


def propose(
    figure: Figure, predict: Predict, characters: Characters, goals: Goals, parts: Blending = WHOLE
) -> Proposal:
    """What the model predicts, blended with the goal."""
    positions = figure.positions(characters.hips, characters.orientations)
    root = figure.frame(positions)
    answer = predict(characters, goals, positions, root)
    distance = (positions - goals.pose_positions).norm(dim=-1).mean(-1)
    styles = answer.trajectory[:, 0, STYLE].clamp(0.0, 1.0)
    action = goals.active * (styles * torch.maximum(goals.action, _CARRIED)).sum(-1).clamp_max(1.0)
    blend, settled = blend_weights(distance, action, characters.blend, characters.settled, goals.urgency, parts)
    facing = goal_frame(figure, goals)
    # Without an active goal there is nothing to blend with, whatever weight is left from before.
    seated = blend * goals.active
    wanted, orientations = blend_pose(answer, characters, positions, root, goals, facing, seated, settled)
    steps, wanted = step(figure, characters, goals, positions, wanted)
    return Proposal(
        before=positions,
        wanted=wanted,
        orientations=limit_turns(figure, characters.orientations, orientations, goals.active),
        contacts=answer.contacts.clamp(0.0, 1.0),
        floor=_standing(figure, goals, styles, seated),
        styles=styles,
        phase=characters.past[:, -1, PHASE] + answer.phase[:, :1].clamp(0.0, _MOST_PHASE),
        future=_future(characters, answer, root, facing, goals),
        seated=seated,
        settled=settled,
        **vars(steps),
    )


def cleared(
    figure: Figure,
    characters: Characters,
    goals: Goals,
    proposal: Proposal,
    around: tuple[Tensor, Furniture] | None,
) -> tuple[Proposal, Tensor]:
    """The proposal out of the furniture, and which feet [B, 2] had to move for it."""
    wanted, orientations = proposal.wanted.clone(), proposal.orientations.clone()
    pushed = torch.zeros_like(wanted[:, :2, 0], dtype=torch.bool)
    if around is not None:
        rows, furniture = around
        clear, turned, pushed[rows] = keep_clear(
            figure, furniture, wanted[rows], orientations[rows], proposal.settled[rows]
        )
        stopped = pushed[rows] & (proposal.share[rows] > 0)
        wanted[rows] = halted(figure, proposal.before[rows], proposal.wanted[rows], clear, stopped)
        # Out of the furniture, but hardly faster than without: a hand pushed as it turns would snap.
        orientations[rows] = limit_turns(figure, characters.orientations[rows], turned, goals.active[rows], _HURRY)
    return replace(proposal, wanted=wanted, orientations=orientations), pushed


def settle(figure: Figure, characters: Characters, proposal: Proposal, pushed: Tensor) -> tuple[Characters, Tensor]:
    """The characters with their feet planted and their series shifted, and their joints [B, J, 3] [m]."""
    feet = plant(
        figure,
        characters,
        proposal.steps,
        proposal.before,
        proposal.wanted,
        proposal.orientations,
        proposal.contacts,
        seated=proposal.seated,
        floor=proposal.floor,
        pushed=pushed,
    )
    after = figure.positions(feet.hips, feet.orientations)
    past = _past(figure, characters, proposal, after)
    whole = past[:, -1:, PHASE].floor()
    moved = Characters(
        hips=feet.hips,
        orientations=feet.orientations,
        velocities=(after - proposal.before) * FRAME_RATE,
        past=torch.cat([past[..., LABELLED], past[..., PHASE] - whole], -1),
        future=torch.cat([proposal.future[..., LABELLED], proposal.future[..., PHASE] - whole], -1),
        contacts=proposal.contacts,
        locks=feet.locks,
        lock_weights=feet.weights,
        settled=proposal.settled,
        blend=proposal.seated,
        standing=proposal.standing,
        steps=proposal.progress,
        manner=characters.manner,
        gaze=characters.gaze,
        linger=characters.linger,
    )
    return moved, after


def _standing(figure: Figure, goals: Goals, styles: Tensor, seated: Tensor) -> Tensor:
    """Whether each contact [B, 4] belongs on the floor: not when lying, and not where the goal's foot hangs."""
    ankles = goals.pose_positions[:, figure.contacts[[0, 2]], 1].repeat_interleave(2, 1)
    hanging = (ankles > _HANGING * size(figure)) & (seated[:, None] > _COMMITTED)
    return (styles[:, LIE.column, None] < 0.5).float() * (~hanging).float()


def _past(figure: Figure, characters: Characters, proposal: Proposal, after: Tensor) -> Tensor:
    """History [B, 31, 9] with the new root appended."""
    root: Frame = figure.frame(after)
    now = torch.cat([root.origin, root.direction, proposal.styles, proposal.phase], -1)
    return torch.cat([characters.past[:, 1:], now[:, None]], 1)


def _future(characters: Characters, answer: Prediction, root: Frame, facing: Frame, goals: Goals) -> Tensor:
    """Future keys [B, 6, 9] in the world."""
    places = blend_trajectory(answer, root, facing, goals)
    phases = characters.past[:, -1:, PHASE] + answer.phase[:, 1:, None].clamp(0.0, 2.0)
    return torch.cat([places, answer.trajectory[:, 1:, STYLE].clamp(0.0, 1.0), phases], -1)
