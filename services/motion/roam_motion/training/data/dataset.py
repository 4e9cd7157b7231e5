"""Episodes flattened to tensors, and the batched views that training takes of them: states, goals, what comes next."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from roam_character.matrices import unit
from roam_character.rotation import quat_to_matrix
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from roam_motion.actions import SIT, STYLES
from roam_motion.animation.figure import Figure
from roam_motion.animation.manner import NAMES
from roam_motion.animation.prediction import Goals
from roam_motion.animation.state import FRAME_RATE, FUTURE, KEY_STRIDE, KEYS, PAST, Characters
from roam_motion.models.lnsm.features import Targets
from roam_motion.training.data.episodes import Episode

_SLOW = 0.3  # [m/s] slower than this is standing
_LEANS = 0.27  # tangent of the lean (15 degrees) that begins a descent
_STANDS = 0.85  # [m] hips higher than this
_NOWHERE = 0.13  # [m] way of a second below which one stands
_BEFORE_SEAT = 30, 0.35  # frames before the command, and [m] of the root's place then, from which a seat's feet count
_TOUCHES = 0.04  # [m] hips over the goal's when the seat carries them
_HANGING = 0.105  # [m] an ankle of a goal pose higher than this does not stand
_SOONER, _LATER = 8, 4  # frames before and after the command
_TAIL = 10  # frames that tell how a path goes on
_PLAN_SMOOTHING = 0.35 * FRAME_RATE  # frames: a planned path knows nothing of the sway of steps


@dataclass
class Dataset:
    """N frames of all episodes end to end; `first` and `last` are each frame's episode bounds."""

    hips: Tensor  # [N, 3]
    orientations: Tensor  # [N, J, 3, 3] world
    root: Tensor  # [N, 4] x, z, direction
    plan: Tensor  # [N, 4] the same, smoothed
    styles: Tensor  # [N, 4]
    phase: Tensor  # [N]
    contacts: Tensor  # [N, 4]
    intent: Tensor  # [N]
    goal: Tensor  # [N] row of the goal tensors or -1
    horizon: Tensor  # [N] last frame that path goals show
    first: Tensor  # [N]
    last: Tensor  # [N]
    weight: Tensor  # [N] how often to start here
    quiet: Tensor  # [N] 1 where someone who stands still may begin to sit down
    feet: Tensor  # [N, 2, 4] where ankles (x, z) and feet (direction) belong before a seat; 0: under the body
    drift: Tensor  # [N, 2] how the path goes on beyond the episode's end [m per frame]
    goal_positions: Tensor  # [G, J, 3]
    goal_orientations: Tensor  # [G, J, 3, 3]
    goal_root: Tensor  # [G, 4]
    goal_active: Tensor  # [G]

    def __len__(self) -> int:
        return len(self.hips)

    def save(self, path: Path) -> None:
        """Cache on disk."""
        torch.save({f.name: getattr(self, f.name) for f in fields(self)}, path)

    @staticmethod
    def load(path: Path) -> "Dataset":
        """From the cache."""
        return Dataset(**torch.load(path, weights_only=True))

    def characters(self, figure: Figure, at: Tensor) -> Characters:
        """The true states at frames `at` [B]."""
        batch = len(at)
        before = torch.maximum(at - 1, self.first[at])
        now = figure.positions(self.hips[at], self.orientations[at])
        then = figure.positions(self.hips[before], self.orientations[before])
        back = torch.maximum(at[:, None] + torch.arange(1 - PAST, 1), self.first[at][:, None])
        ahead = self._clamped(at, torch.arange(1, FUTURE + 1) * KEY_STRIDE)
        contacts = self.contacts[at]
        phase = self.phase[at].floor()[:, None, None]
        past = torch.cat([self.root[back], self.styles[back], self.phase[back][..., None] - phase], -1)
        roots = self._roots(at, torch.arange(1, FUTURE + 1) * KEY_STRIDE)
        future = torch.cat([roots, self.styles[ahead], self.phase[ahead][..., None] - phase], -1)
        return Characters(
            hips=self.hips[at],
            orientations=self.orientations[at],
            velocities=(now - then) * FRAME_RATE,
            past=past,
            future=future,
            contacts=contacts,
            locks=now[:, figure.contacts],
            lock_weights=contacts.clone(),
            settled=torch.zeros(batch),
            blend=torch.zeros(batch),
            standing=self._stands(at),
            steps=torch.zeros(batch, 2),
            manner=torch.zeros(batch, len(NAMES)),
            gaze=torch.zeros(batch, 3),
            linger=torch.zeros(batch, 3),
        )

    def _stands(self, at: Tensor) -> Tensor:
        """Who goes nowhere in the second that comes, and is up [B]."""
        gone = (self.root[self._clamped(at, torch.tensor([FRAME_RATE]))[:, 0], :2] - self.root[at, :2]).norm(dim=-1)
        return ((gone < _NOWHERE) & (self.hips[at, 1] > _STANDS)).float()

    def _clamped(self, at: Tensor, steps: Tensor) -> Tensor:
        return torch.minimum(at[:, None] + steps, self.last[at][:, None])

    def _roots(self, at: Tensor, steps: Tensor) -> Tensor:
        """Roots [B, K, 4] so many steps [K] after frames `at`, going on beyond the end as they end."""
        keys = self._clamped(at, steps)
        beyond = (at[:, None] + steps - keys)[..., None] * self.drift[at][:, None]
        return self.root[keys] + torch.cat([beyond, torch.zeros_like(beyond)], -1)

    def goals(self, at: Tensor) -> Goals:
        """Goals at frames `at` [B]: the planned path 0..2 s ahead, or the goal pose's root."""
        steps = torch.arange(KEYS) * KEY_STRIDE
        seen = torch.minimum(at[:, None] + steps, self.horizon[at][:, None]).clamp_min(0)
        shown = torch.maximum(seen, at[:, None])
        beyond = (at[:, None] + steps - shown)[..., None] * self.drift[at][:, None]
        path = self.plan[shown] + torch.cat([beyond, torch.zeros_like(beyond)], -1)
        row = self.goal[at]
        fixed, safe = row >= 0, row.clamp_min(0)
        active, pose = self.goal_active[safe] * fixed, self.goal_positions[safe]
        keys = torch.where(fixed[:, None, None], self.goal_root[safe][:, None].expand(-1, KEYS, -1), path)
        return Goals(
            positions=keys[..., :2],
            directions=keys[..., 2:],
            action=torch.nn.functional.one_hot(self.intent[at], len(STYLES)).float(),
            active=active,
            pose_positions=pose,
            pose_orientations=self.goal_orientations[safe],
            feet=self.feet[at],
            urgency=torch.zeros(len(at)),
        )

    def targets(self, figure: Figure, at: Tensor) -> Targets:
        """What comes after frames `at` [B] in the data."""
        after = torch.minimum(at + 1, self.last[at])
        steps = 1 + torch.arange(FUTURE + 1) * KEY_STRIDE
        keys, roots = self._clamped(at, steps), self._roots(at, steps)
        return Targets(
            positions=figure.positions(self.hips[after], self.orientations[after]),
            orientations=self.orientations[after],
            trajectory=torch.cat([roots, self.styles[keys]], -1),
            contacts=self.contacts[after],
            phase=self.phase[keys] - self.phase[at][:, None],
        )


def build(figure: Figure, episodes: list[Episode], weights: Sequence[float | np.ndarray]) -> Dataset:
    """One dataset of many episodes; `weights` say how often each episode's frames ([T], or all alike) are drawn."""
    parts = []
    start, goal_start = 0, 0
    for episode, weight in zip(episodes, weights, strict=True):
        parts.append(_part(figure, episode, weight, start, goal_start))
        start, goal_start = start + len(episode.clip), goal_start + len(episode.goals)
    if goal_start == 0:  # only walking: one row that nothing points to
        parts.append(dict.fromkeys((f.name for f in fields(Dataset)), torch.zeros(0)) | _no_goal(figure))
    return Dataset(**{f.name: torch.cat([p[f.name] for p in parts if len(p[f.name])]) for f in fields(Dataset)})


def _no_goal(figure: Figure) -> dict[str, Tensor]:
    orientations = torch.eye(3).expand(1, figure.joint_count, 3, 3)
    return {
        "goal_positions": figure.positions(torch.zeros(1, 3), orientations),
        "goal_orientations": orientations,
        "goal_root": torch.tensor([[0.0, 0.0, 0.0, 1.0]]),
        "goal_active": torch.zeros(1),
    }


def _part(
    figure: Figure, episode: Episode, weight: float | np.ndarray, start: int, goal_start: int
) -> dict[str, Tensor]:
    clip = episode.clip
    count = len(clip)
    hips = torch.tensor(clip.root_positions, dtype=torch.float32)
    orientations = figure.world(quat_to_matrix(torch.tensor(clip.rotations, dtype=torch.float32)))
    root = _roots(figure, hips, orientations)
    goal = torch.tensor(episode.goal)
    part = {
        "hips": hips,
        "orientations": orientations,
        "root": root,
        "plan": _smoothed(root),
        "styles": torch.tensor(episode.styles, dtype=torch.float32),
        "phase": torch.tensor(episode.phase, dtype=torch.float32),
        "contacts": torch.tensor(episode.contacts, dtype=torch.float32),
        "intent": torch.tensor(episode.intent),
        "goal": torch.where(goal >= 0, goal + goal_start, goal),
        "horizon": torch.tensor(episode.horizon) + start,
        "first": torch.full((count,), start),
        "last": torch.full((count,), start + count - 1),
        "weight": torch.as_tensor(weight, dtype=torch.float64).expand(count).clone(),
        "quiet": _quiet(figure, episode, hips, orientations, root),
        "feet": _feet(figure, episode, hips, orientations, root),
        "drift": _drift(episode, root).expand(count, 2).clone(),
    }
    return part | _goal_part(figure, episode)


def _quiet(figure: Figure, episode: Episode, hips: Tensor, orientations: Tensor, root: Tensor) -> Tensor:
    """Frames [T] around the command to sit down in which both feet stand, the body is slow and has not begun to
    lean."""
    active = np.flatnonzero(episode.goal == 0)
    count = len(episode.clip)
    if not len(active) or active[0] == 0 or episode.intent[active[0]] != SIT.column:
        return torch.zeros(count)
    positions = figure.positions(hips, orientations)
    trunk = positions[:, figure.skeleton.index("neck")] - positions[:, 0]
    leans = (trunk[:, ::2] * root[:, 2:]).sum(-1) / trunk[:, 1]
    speed = torch.gradient(root[:, :2], dim=0)[0].norm(dim=-1) * FRAME_RATE
    stands = torch.tensor(episode.contacts[:, [0, 2]].all(1))
    at = torch.arange(count) - int(active[0])
    quiet = stands & (speed < _SLOW) & (leans < _LEANS) & (hips[:, 1] > _STANDS) & (at >= -_SOONER) & (at < _LATER)
    return quiet.float()


def _feet(figure: Figure, episode: Episode, hips: Tensor, orientations: Tensor, root: Tensor) -> Tensor:
    """Where both feet are when the seat carries the body [T, 2, 4], for the frames before a seat and on it."""
    count, active = len(episode.clip), np.flatnonzero(episode.goal == 0)
    feet = torch.zeros(count, 2, 4)
    if not len(active) or active[0] == 0 or episode.intent[active[0]] != SIT.column:
        return feet
    command, told = int(active[0]), int(active[-1]) + 1
    low = torch.nonzero(hips[command:told, 1] < float(episode.goals[0][0].hips[1]) + _TOUCHES)
    joints = figure.positions(hips, orientations)[:, figure.contacts].unflatten(1, (2, 2))
    if not len(low) or float(joints[told - 1, :, 0, 1].max()) > _HANGING:
        return feet
    ankles, ways = joints[command + int(low[0])].unbind(1)
    ways = unit((ways - ankles)[:, ::2])
    near = (root[:, :2] - root[command, :2]).norm(dim=-1) < _BEFORE_SEAT[1]
    at = torch.arange(count)
    near = (near & (at >= command - _BEFORE_SEAT[0])) | (at >= command)
    feet[near & (at < told)] = torch.cat([ankles[:, ::2], ways], -1)
    return feet


def _drift(episode: Episode, root: Tensor) -> Tensor:
    """How the path of a stretch of locomotion goes on at its end [2] [m per frame]; nought where it ends standing."""
    if episode.goals or len(root) < _TAIL + 1:
        return torch.zeros(2)
    drift = (root[-1, :2] - root[-1 - _TAIL, :2]) / _TAIL
    return drift if float(drift.norm()) * FRAME_RATE > _SLOW else torch.zeros(2)


def _goal_part(figure: Figure, episode: Episode) -> dict[str, Tensor]:
    if not episode.goals:
        none = torch.zeros(0)
        return dict.fromkeys(("goal_positions", "goal_orientations", "goal_root", "goal_active"), none)
    hips = torch.tensor(np.stack([key.hips for key, _ in episode.goals]), dtype=torch.float32)
    rotations = torch.tensor(np.stack([key.rotations for key, _ in episode.goals]), dtype=torch.float32)
    orientations = figure.world(quat_to_matrix(rotations))
    return {
        "goal_positions": figure.positions(hips, orientations),
        "goal_orientations": orientations,
        "goal_root": _roots(figure, hips, orientations),
        "goal_active": torch.tensor([float(active) for _, active in episode.goals]),
    }


def _roots(figure: Figure, hips: Tensor, orientations: Tensor) -> Tensor:
    frame = figure.frame(figure.positions(hips, orientations))
    return torch.cat([frame.origin, frame.direction], -1)


def _smoothed(root: Tensor) -> Tensor:
    smooth = torch.tensor(gaussian_filter1d(root.numpy(), _PLAN_SMOOTHING, axis=0, mode="nearest"))
    direction = smooth[:, 2:] / smooth[:, 2:].norm(dim=-1, keepdim=True).clamp_min(1e-6)
    return torch.cat([smooth[:, :2], direction], -1)
