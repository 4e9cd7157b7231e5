"""Several good poses instead of one: ranked by fit, told apart by place, heading and posture."""

import torch
from torch import Tensor

from roam_goalpose.solvers.candidates import Candidates, facing_yaw

APART = 0.35  # [m] hips further from each other than this are on different places
ASIDE = 0.8  # [rad] headings further from each other than this differ
TAKEN = 0.25  # by how much worse a pose counts for every better one that sits where it sits ...
ELBOWS = 0.45  # [m] ... and by how much less the further their hips are from each other, until it is nothing here
WORST = 0.6  # poses whose energy is that much above the best are no choice


def choose_diverse(candidates: Candidates, count: int) -> Tensor:
    """Indices of up to `count` candidates: the best first, then those that are good and unlike the ones before.

    A pose like an earlier one in place, heading and reference is never chosen; one that shares only the place can be,
    when no other place is nearly as good.
    """
    root, yaw = candidates.figure.root_position, facing_yaw(candidates.figure)
    turn = yaw[:, None] - yaw[None]
    between = torch.linalg.vector_norm(root[:, None] - root[None], dim=-1)
    crowded = TAKEN * (1.5 * (1.0 - between / ELBOWS)).clamp(0.0, 1.0)  # fading: a limit would hang on a centimetre
    alike = (between < APART) & (torch.atan2(turn.sin(), turn.cos()).abs() < ASIDE)
    same = alike & (candidates.reference[:, None] == candidates.reference[None])
    score = candidates.fit.clone()
    best = float(score.min())
    chosen: list[int] = []
    while len(chosen) < count and float(score.min()) < float("inf"):
        index = int(score.argmin())
        chosen.append(index)
        score = torch.where(same[index], torch.inf, score + crowded[index])
        score[candidates.fit > best + WORST] = torch.inf
    return torch.tensor(chosen)
