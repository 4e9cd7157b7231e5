"""Episodes: stretches of motion with an intent and a goal at every frame, real or warped towards a new goal pose.

A lying episode approaches, lies down, holds, and gets up. Its frames are bent towards the goal pose with a weight that
rises to one at the first held frame, as local rotations, so limbs stay limbs. While held, the clip's own fidgeting
remains at a sixth of its size: living, but at the goal. Sitting episodes are made in sitting.py.
"""

from dataclasses import dataclass

import numpy as np
from roam_character.clip import Clip
from roam_character.kinematics import facing
from roam_character.rotation import quat_inv, quat_mul, quat_slerp
from roam_character.skeleton import Skeleton

from roam_motion.actions import IDLE, LIE, WALK
from roam_motion.animation.figure import CONTACT_JOINTS
from roam_motion.animation.state import FRAME_RATE
from roam_motion.training.data import labels
from roam_motion.training.data.goals import Bank, Key, aligned, new_goal
from roam_motion.training.data.recordings import Recording, Span

_LIVING = 0.15  # share of the clip's own motion that remains while held
_BEFORE = 80  # frames of approach kept
_AFTER = 60  # frames after standing up kept
_SHORTEST = 30  # frames of a stretch of locomotion


@dataclass(frozen=True)
class Episode:
    """T frames with their intent; goals are indices into `goals`, -1 where the goal is the path itself."""

    name: str
    clip: Clip
    contacts: np.ndarray  # [T, 4] bool
    styles: np.ndarray  # [T, 4] soft labels
    phase: np.ndarray  # [T] turns, unwrapped
    intent: np.ndarray  # [T] index into STYLES
    goal: np.ndarray  # [T] index into goals, or -1
    horizon: np.ndarray  # [T] last frame whose root the path goals of this frame may show
    goals: tuple[tuple[Key, bool], ...]  # pose and whether it is an interaction (False: only its root, to stand at)


def locomotion(recording: Recording, skeleton: Skeleton) -> list[Episode]:
    """The walking, turning and standing stretches of a recording."""
    contacts, styles, phase, names = labelled(recording)
    free = np.ones(len(recording.clip), bool)
    for span in recording.spans:
        free[(span.down or 0) : (span.up or len(free)) + 1] = False
    free &= np.array([n in labels.LOCOMOTION for n in names])
    out = []
    for first, last in _stretches(free, _SHORTEST):
        cut = slice(first, last + 1)
        idle = np.array([n == "idle" for n in names[cut]])
        count = last - first + 1
        out.append(
            Episode(
                recording.name,
                recording.clip.cut(first, last),
                contacts[cut],
                styles[cut],
                phase[cut],
                np.where(idle, IDLE.column, WALK.column),
                np.full(count, -1),
                np.full(count, count - 1),
                (),
            )
        )
    return out


def _stretches(mask: np.ndarray, shortest: int) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= shortest]


def labelled(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Contacts [T, 4], soft styles [T, 4], gait phase [T] and label names of a recording at its own rate."""
    clip = recording.clip
    positions = clip.positions()
    joints = clip.skeleton.indices(CONTACT_JOINTS)
    contacts = labels.find_contacts(positions, clip.frame_rate, joints)
    if recording.ankle_contacts is not None:
        contacts[:, [0, 2]] = recording.ankle_contacts
    names = recording.segments
    if names is None:
        yaw = np.unwrap(facing(clip.skeleton, positions))
        names = labels.moving(positions[:, 0, [0, 2]], yaw, clip.frame_rate)
    names = list(names)
    for span in recording.spans:
        down, up = span.down or 0, span.up or len(names) - 1
        names[down : up + 1] = [span.action] * (up + 1 - down)
        if span.action == "lie":  # getting onto the furniture and off it is sitting
            half = (up - span.last) * 6 // 10
            names[down : down + (span.first - down) // 3] = ["sit"] * ((span.first - down) // 3)
            names[span.last + half : up + 1] = ["sit"] * (up + 1 - span.last - half)
    return contacts, labels.soft_actions(names, clip.frame_rate), labels.find_phase(contacts, clip.frame_rate), names


def lying(recording: Recording, span: Span, banks: dict[str, Bank], rng: np.random.Generator) -> Episode | None:
    """One lying span bent towards a new goal pose; None when the span is too short to be of use."""
    clip, skeleton = recording.clip, recording.clip.skeleton
    if span.last - span.first < 4:
        return None
    keys = tuple(Key(clip.root_positions[t], clip.rotations[t]) for t in (span.first, span.last))
    goal = new_goal(skeleton, span.action, banks[span.action], keys[0], rng)
    goal = aligned(skeleton, goal, keys[0], rng, by_feet=False)
    down = span.down if span.down is not None else span.first
    up = span.up if span.up is not None else span.last
    start = span.first if span.down is None else max(0, down - _BEFORE)
    end = span.last if span.up is None else min(len(clip) - 1, up + _AFTER)
    order, weight, living, lead = _timeline(span, start, end, rng)
    hips, rotations = _warp(clip, (keys[0], keys[1]), goal, order, weight, living, lead)
    contacts, styles, phase, _ = labelled(recording)
    contacts, phase = contacts[order].copy(), _continued(phase, order)
    bent = Clip(skeleton, clip.frame_rate, hips.astype(np.float32), rotations.astype(np.float32))
    return _episode(recording, span, bent, (contacts, styles[order], phase), order, goal, (down, up), rng)


def _timeline(
    span: Span, start: int, end: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Source frame per episode frame, pull towards the goal, share of own motion while held, and which key counts."""
    half = int(rng.integers(20, 60))
    held = np.arange(span.first, span.last + 1)
    lead = np.ones(len(held), bool)
    if len(held) > 2 * half:
        held = np.concatenate([held[:half], held[-half:]])
        lead = np.arange(len(held)) < half
    else:
        lead = np.arange(len(held)) < len(held) // 2
    order = np.concatenate([np.arange(start, span.first), held, np.arange(span.last + 1, end + 1)])
    before, after = span.first - start, end - span.last
    weight = np.ones(len(order), np.float32)
    down = span.down if span.down is not None else span.first
    up = span.up if span.up is not None else span.last
    # The pull begins before the descent, so that body and goal meet without haste.
    weight[:before] = smooth((np.arange(start, span.first) - (down - 20)) / (span.first - down + 20 + 1e-6))
    if after:
        weight[-after:] = smooth((up + 10 - np.arange(span.last + 1, end + 1)) / (up + 10 - span.last + 1e-6))
    living = np.zeros(len(order), np.float32)
    middle = int(lead.sum())
    rise = np.minimum(np.abs(np.arange(len(held)) - middle) / 10.0, 1.0)
    edge = np.minimum(np.arange(len(held)), np.arange(len(held))[::-1]) / 10.0
    living[before : before + len(held)] = _LIVING * rise + (1 - _LIVING) * np.maximum(1 - edge, 0) * (rise >= 1)
    leads = np.concatenate([np.ones(before, bool), lead, np.zeros(after, bool)])
    return order, weight, living, leads


def smooth(x: np.ndarray) -> np.ndarray:
    """0 to 1 over [0, 1], speed and acceleration zero at both ends."""
    x = np.clip(x, 0, 1)
    return np.asarray(x * x * x * (x * (6 * x - 15) + 10), np.float32)


def _warp(
    clip: Clip,
    keys: tuple[Key, Key],
    goal: Key,
    order: np.ndarray,
    weight: np.ndarray,
    living: np.ndarray,
    lead: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Hips [T, 3] and local rotations [T, J, 4]: q(t) (q_key^-1 q_goal)^w, and while held q_goal (q_key^-1
    q(t))^living."""
    hips, rotations = clip.root_positions[order], clip.rotations[order]
    chosen = np.where(lead, 0, 1)
    key_hips = np.stack([k.hips for k in keys])[chosen]
    key_rotations = np.stack([k.rotations for k in keys])[chosen]
    w = weight[:, None]
    held = (weight >= 1.0)[:, None]
    moved = hips + w * (goal.hips - key_hips)
    lives = goal.hips + living[:, None] * (hips - key_hips)
    out_hips = np.where(held, lives, moved)
    goal_rotations = np.broadcast_to(goal.rotations, rotations.shape)
    identity = np.zeros_like(rotations)
    identity[..., 3] = 1
    pull = quat_slerp(identity, quat_mul(quat_inv(key_rotations), goal_rotations), w[..., None])
    own = quat_slerp(identity, quat_mul(quat_inv(key_rotations), rotations), living[:, None, None])
    out = np.where(held[..., None], quat_mul(goal_rotations, own), quat_mul(rotations, pull))
    # The root turns in the world, not in its own frame: its pull multiplies on the left.
    turn = quat_slerp(identity[:, 0], quat_mul(goal_rotations[:, 0], quat_inv(key_rotations[:, 0])), w)
    out[:, 0] = np.where(held, out[:, 0], quat_mul(turn, rotations[:, 0]))
    return out_hips, out


def _continued(phase: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Unwrapped phase along the episode: cuts in the hold go on at a slow, constant rate."""
    change = np.diff(phase[order], prepend=phase[order[0]])
    jump = np.diff(order, prepend=order[0]) > 1
    change[jump] = 1 / (4.0 * FRAME_RATE)
    return np.asarray(phase[order[0]] + np.cumsum(change), np.float32)


def _episode(
    recording: Recording,
    span: Span,
    bent: Clip,
    tracks: tuple[np.ndarray, np.ndarray, np.ndarray],
    order: np.ndarray,
    goal: Key,
    upright: tuple[int, int],
    rng: np.random.Generator,
) -> Episode:
    contacts, styles, phase = tracks
    count = len(order)
    down, up = upright
    # The command to lie comes a little before the descent, the command to rise a little before the rise.
    switch = int(np.argmax(order >= down)) - int(rng.integers(0, 25))
    switch = max(switch, 0)
    rise = int(np.argmax(order >= span.last)) - int(rng.integers(20, 40)) if span.up is not None else count
    stand = int(np.argmax(order >= up)) if span.up is not None else count
    intent, at, horizon = np.full(count, WALK.column), np.full(count, -1), np.full(count, switch)
    intent[switch:rise], at[switch:rise] = LIE.column, 0
    intent[rise:stand], at[rise:stand] = IDLE.column, 1
    horizon[stand:] = count - 1
    standing = Key(bent.root_positions[min(stand, count - 1)], bent.rotations[min(stand, count - 1)])
    return Episode(
        recording.name, bent, contacts, styles, phase, intent, at, horizon, ((goal, True), (standing, False))
    )
