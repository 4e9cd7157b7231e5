"""What the product does when it is told to walk, turn, stop, sit, lie and get up: frames for the measures.

Scenes are batches of characters that are stepped together; every frame shown is kept, nothing is smoothed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from roam_motion.animator import Animator, CharacterState, Idle, Intent, Steer

from roam_evaluation.motion.goals import SeatGoal
from roam_evaluation.motion.people.frames import RATE, Motion, Stretch
from roam_evaluation.motion.runs import REACHED, draw_starts

WALKS = (0.6, 0.9, 1.2, 1.5, 1.8)  # [m/s]
RUNS = (2.2, 2.8, 3.4)
TURNS = (90, 135, 180)  # [degrees]
_STAND, _GO, _HALT = 45, 270, 120  # frames of a steered walk
GOING = slice(_STAND, _STAND + _GO)  # the frames in which it is told to walk
_TURN = 150  # frames to turn in
_APPROACH = {"sit": 300, "lie": 450}  # frames until the goal must be reached
_HOLD = {"sit": 300, "lie": 150}  # frames that the goal is then held
_LEAVE = {"sit": 150, "lie": 330}
_BATCH = 32

Script = Callable[[int], Intent]


@dataclass(frozen=True, eq=False)
class Scene:
    """One character: where it starts, and what it is told at every frame."""

    name: str
    told: str
    seed: int
    start: tuple[float, float, float]  # x, z [m], heading [rad]
    script: Script
    frames: int


def perform(animator: Animator, scenes: Sequence[Scene]) -> list[Motion]:
    """All scenes, in batches. Scenes shorter than the longest of their batch are cut to their own length."""
    found: list[Motion] = []
    for begin in range(0, len(scenes), _BATCH):
        part = scenes[begin : begin + _BATCH]
        states: list[CharacterState] = [animator.start(s.start[:2], s.start[2], s.seed) for s in part]
        shown = []
        for t in range(max(s.frames for s in part)):
            pairs = animator.step(states, [s.script(t) for s in part])
            states = [state for state, _ in pairs]
            shown.append(np.stack([frame.positions for _, frame in pairs]))
        tracks = np.stack(shown, 1).astype(np.float64)  # [N, T, J, 3]
        found += [Motion(s.name, str(s.seed), p[: s.frames], (), s.told) for s, p in zip(part, tracks, strict=True)]
    return found


def steered(speeds: Sequence[float], seeds: Sequence[int]) -> list[Scene]:
    """Standing, walking straight on at a speed for nine seconds, stopping for four."""
    scenes = []
    for speed in speeds:
        for seed in seeds:
            heading = 0.7 * seed
            velocity = speed * np.array([math.sin(heading), math.cos(heading)])
            script = _in_turn((_STAND, Idle()), (_GO, Steer(velocity)), (_HALT, Idle()))
            name = f"steer {speed:g} m/s, seed {seed}"
            scenes.append(Scene(name, f"steer {speed:g}", seed, (0.0, 0.0, heading), script, _STAND + _GO + _HALT))
    return scenes


def on_the_spot(angles: Sequence[int], seeds: Sequence[int]) -> list[Scene]:
    """Standing, then told to face elsewhere; every other seed turns to the right."""
    scenes = []
    for angle in angles:
        for seed in seeds:
            goal = math.radians(angle) * (1 if seed % 2 else -1)
            facing = np.array([math.sin(goal), math.cos(goal)])
            script = _in_turn((_STAND, Idle()), (_TURN, Steer(np.zeros(2), facing)))
            name = f"turn {angle} degrees, seed {seed}"
            scenes.append(Scene(name, f"turn {angle}", seed, (0.0, 0.0, 0.0), script, _STAND + _TURN))
    return scenes


def standing(seeds: Sequence[int], seconds: float = 12.0) -> list[Scene]:
    """Nothing asked for."""
    frames = int(seconds * RATE)
    return [Scene(f"idle, seed {s}", "idle", s, (0.0, 0.0, 0.5 * s), lambda _: Idle(), frames) for s in seeds]


def _in_turn(*parts: tuple[int, Intent]) -> Script:
    """A script that gives each intent for so many frames, the last for ever."""
    ends = np.cumsum([frames for frames, _ in parts])

    def script(t: int) -> Intent:
        return parts[min(int(np.searchsorted(ends, t, side="right")), len(parts) - 1)][1]

    return script


def approaches(animator: Animator, goals: Sequence[SeatGoal], count: int, *, seed: int = 0) -> list[Motion]:
    """`count` approaches from 2-4 m away: walking up, taking the pose, holding it, getting up.

    What is held is labelled `sit held` or `lie held`; an approach that never arrives has no such stretch.
    """
    chosen = [goals[i % len(goals)] for i in range(count)]
    starts = draw_starts(chosen, spread=math.radians(60), seed=seed)
    scenes = []
    for goal, start in zip(chosen, starts, strict=True):
        until = _APPROACH[goal.action] + _HOLD[goal.action]
        script = _in_turn((until, goal.intent), (_LEAVE[goal.action], Idle()))
        place = (start.x, start.z, start.heading)
        name = f"{goal.action} on {goal.name}, seed {start.seed}"
        scenes.append(Scene(name, goal.action, start.seed, place, script, until + _LEAVE[goal.action]))
    return [_labelled(m, goal) for m, goal in zip(perform(animator, scenes), chosen, strict=True)]


def _labelled(motion: Motion, goal: SeatGoal) -> Motion:
    """With the stretch in which the goal is held."""
    until = _APPROACH[goal.action] + _HOLD[goal.action]
    distance = np.linalg.norm(motion.positions[:until] - goal.pose.positions(), axis=-1).mean(-1)
    within = np.flatnonzero(distance <= REACHED)
    held = (Stretch(f"{goal.action} held", int(within[0]), until - 1),) if len(within) else ()
    return replace(motion, stretches=held)
