"""One frame of B characters: encode, predict, blend, plant the feet, shift the series.

Training roll-outs and the service call this same function, so training sees exactly what runs.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from motion.blending import WHOLE, Blending, blend_pose, blend_trajectory, blend_weights, limit_turns
from motion.clearance import Furniture, keep_clear
from motion.contact_ik import plant
from motion.features import Answer, Goals, Inputs, decode, encode, goal_frame
from motion.figure import Figure, Frame
from motion.state import FRAME_RATE, Characters

# Normalised network call: raw inputs -> raw output [B, O].
Predict = Callable[[Inputs], Tensor]

_HANGING = 0.105  # [m] an ankle higher than this does not stand on the floor
_COMMITTED = 0.3  # blending weight from which feet go where the goal pose has them
_HURRY = 1.15  # times as fast as else bones may turn out of furniture
_MOST_PHASE = 0.08  # [turns] per frame: 2.4 gait cycles a second


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
    positions = figure.positions(characters.hips, characters.orientations)
    root = figure.frame(positions)
    output = predict(encode(figure, characters, goals, positions, root))
    answer = decode(output, characters, positions, root)
    distance = (positions - goals.pose_positions).norm(dim=-1).mean(-1)
    styles = answer.trajectory[:, 0, 4:8].clamp(0.0, 1.0)
    action = goals.active * (styles[:, 2] + styles[:, 3]).clamp_max(1.0)
    blend, settled = blend_weights(distance, action, characters.blend, characters.settled, goals.urgency, parts)
    facing = goal_frame(figure, goals)
    # Without an active goal there is nothing to blend with, whatever weight is left from before.
    seated = blend * goals.active
    wanted, orientations = blend_pose(answer, characters, positions, root, goals, facing, seated, settled)
    orientations = limit_turns(figure, characters.orientations, orientations, goals.active)
    pushed = None
    if around is not None:
        rows, furniture = around
        pushed = torch.zeros(len(wanted), 2, dtype=torch.bool)
        wanted[rows], orientations[rows], pushed[rows] = keep_clear(
            figure, furniture, wanted[rows], orientations[rows], settled[rows]
        )
        # Out of the furniture, but hardly faster than without: a hand pushed as it turns would snap.
        orientations = limit_turns(figure, characters.orientations, orientations, goals.active, _HURRY)
    contacts = answer.contacts.clamp(0.0, 1.0)
    floor = _standing(figure, goals, styles, seated)
    feet = plant(
        figure, characters, positions, wanted, orientations, contacts, seated=seated, floor=floor, pushed=pushed
    )
    after = figure.positions(feet.hips, feet.orientations)
    moved = Characters(
        hips=feet.hips,
        orientations=feet.orientations,
        velocities=(after - positions) * FRAME_RATE,
        past=_past(figure, characters, answer, after, styles),
        future=_future(characters, answer, root, facing, goals),
        contacts=contacts,
        locks=feet.locks,
        lock_weights=feet.weights,
        settled=settled,
        blend=seated,
    )
    whole = moved.past[:, -1:, 8:].floor()
    moved.past = torch.cat([moved.past[..., :8], moved.past[..., 8:] - whole], -1)
    moved.future = torch.cat([moved.future[..., :8], moved.future[..., 8:] - whole], -1)
    return moved, after, (after - goals.pose_positions).norm(dim=-1).mean(-1)


def _standing(figure: Figure, goals: Goals, styles: Tensor, seated: Tensor) -> Tensor:
    """Whether each contact [B, 4] belongs on the floor: not when lying, and not where the goal's foot hangs."""
    ankles = goals.pose_positions[:, figure.contacts[[0, 2]], 1].repeat_interleave(2, 1)
    hanging = (ankles > _HANGING) & (seated[:, None] > _COMMITTED)
    return (styles[:, 3:] < 0.5).float() * (~hanging).float()


def _past(figure: Figure, characters: Characters, answer: Answer, after: Tensor, styles: Tensor) -> Tensor:
    """History [B, 31, 9] with the new root appended."""
    root: Frame = figure.frame(after)
    phase = characters.past[:, -1, 8:] + answer.phase[:, :1].clamp(0.0, _MOST_PHASE)
    now = torch.cat([root.origin, root.direction, styles, phase], -1)
    return torch.cat([characters.past[:, 1:], now[:, None]], 1)


def _future(characters: Characters, answer: Answer, root: Frame, facing: Frame, goals: Goals) -> Tensor:
    """Future keys [B, 6, 9] in the world."""
    places = blend_trajectory(answer, root, facing, goals)
    phases = characters.past[:, -1:, 8:] + answer.phase[:, 1:, None].clamp(0.0, 2.0)
    return torch.cat([places, answer.trajectory[:, 1:, 4:8].clamp(0.0, 1.0), phases], -1)
