"""Episodes: stretches of motion with an intent and a goal at every frame, real or warped towards a new goal pose.

An interaction episode approaches, sits (or lies) down, holds, and leaves. Its frames are bent towards the goal pose
with a weight that rises to one at the first held frame, as local rotations, so limbs stay limbs. Planted feet stay
planted: a foot whose place in the goal pose differs from where the clip put it makes one small adjusting step,
lifted, late in the descent (and back before rising). While held, the clip's own fidgeting remains at a sixth of its
size: living, but at the goal.
"""

from dataclasses import dataclass

import numpy as np
from roam_character.clip import Clip
from roam_character.kinematics import facing, forward_kinematics, limb, reach_with_limb
from roam_character.rotation import quat_inv, quat_mul, quat_nlerp, quat_rotate, quat_slerp
from roam_character.skeleton import Skeleton

from roam_motion.actions import ACTIONS, IDLE, SIT, WALK
from roam_motion.animation.figure import CONTACT_JOINTS
from roam_motion.animation.state import FRAME_RATE
from roam_motion.training import labels
from roam_motion.training.goals import LEGS, Bank, Key, aligned, new_goal
from roam_motion.training.recordings import Recording, Span

_LIVING = 0.15  # share of the clip's own motion that remains while held
_ADJUST = 12  # frames of an adjusting step
_LIFT = 0.035  # its height [m]
_BEFORE = 80  # frames of approach kept
_AFTER = 60  # frames after standing up kept


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
    contacts, styles, phase, names = _labels(recording)
    free = np.ones(len(recording.clip), bool)
    for span in recording.spans:
        free[(span.down or 0) : (span.up or len(free)) + 1] = False
    free &= np.array([n in ("idle", "walk", "turn") for n in names])
    out = []
    for first, last in _stretches(free, 60):
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


def _labels(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
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


def interaction(recording: Recording, span: Span, banks: dict[str, Bank], rng: np.random.Generator) -> Episode | None:
    """One span bent towards a new goal pose; None when the span is too short to be of use."""
    clip, skeleton = recording.clip, recording.clip.skeleton
    if span.last - span.first < 4:
        return None
    first_key, last_key = (Key(clip.root_positions[t], clip.rotations[t]) for t in (span.first, span.last))
    goal = new_goal(skeleton, span.action, banks[span.action], first_key, rng)
    goal = aligned(skeleton, goal, first_key, rng, by_feet=span.action == SIT.name)
    return _bent(recording, span, goal, (first_key, last_key), rng)


def _bent(recording: Recording, span: Span, goal: Key, keys: tuple[Key, Key], rng: np.random.Generator) -> Episode:
    clip, skeleton = recording.clip, recording.clip.skeleton
    down = span.down if span.down is not None else span.first
    up = span.up if span.up is not None else span.last
    start, end = max(0, down - _BEFORE), min(len(clip) - 1, up + _AFTER)
    if span.down is None:
        start = span.first
    if span.up is None:
        end = span.last
    order, weight, living, lead = _timeline(span, start, end, rng)
    hips, rotations = _warp(clip, keys, goal, order, weight, living, lead)
    contacts, styles, phase, _ = _labels(recording)
    contacts, phase = contacts[order].copy(), _continued(phase, order)
    bent = Clip(skeleton, clip.frame_rate, hips.astype(np.float32), rotations.astype(np.float32))
    if span.action == SIT.name:
        marks = [int(np.argmax(order >= t)) for t in (down, span.first, span.last, up)]
        bent, contacts = _planted(clip, order, bent, goal, contacts, marks, rng)
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
    weight[:before] = _smooth((np.arange(start, span.first) - (down - 20)) / (span.first - down + 20 + 1e-6))
    if after:
        weight[-after:] = _smooth((up + 10 - np.arange(span.last + 1, end + 1)) / (up + 10 - span.last + 1e-6))
    living = np.zeros(len(order), np.float32)
    middle = int(lead.sum())
    rise = np.minimum(np.abs(np.arange(len(held)) - middle) / 10.0, 1.0)
    edge = np.minimum(np.arange(len(held)), np.arange(len(held))[::-1]) / 10.0
    living[before : before + len(held)] = _LIVING * rise + (1 - _LIVING) * np.maximum(1 - edge, 0) * (rise >= 1)
    leads = np.concatenate([np.ones(before, bool), lead, np.zeros(after, bool)])
    return order, weight, living, leads


def _smooth(x: np.ndarray) -> np.ndarray:
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


def _planted(
    source: Clip,
    order: np.ndarray,
    bent: Clip,
    goal: Key,
    contacts: np.ndarray,
    marks: list[int],
    rng: np.random.Generator,
) -> tuple[Clip, np.ndarray]:
    """Legs by IK: feet where the clip has them, in between one adjusting step to the goal's place and one back."""
    skeleton = source.skeleton
    own = source.posture()
    own_positions, own_turns = own.positions[order], own.orientations[order]
    there = forward_kinematics(skeleton, goal.hips, goal.rotations)
    down, first, last, up = marks
    rotations = bent.rotations.copy()
    gap = int(rng.integers(6, 18))
    sides = rng.permutation(2)
    arrive = int(down + (0.6 + 0.4 * rng.random()) * (first - down))
    leave = max(last - int(rng.integers(20, 40)), arrive + 2 * _ADJUST + gap)
    for turn, side in enumerate(sides):
        which = limb(skeleton, LEGS[side])
        begin, back = arrive + turn * gap, leave + turn * (gap // 2)
        share, lift = _adjusting(len(order), begin, back, has_rise=up > last, has_fall=first > 0)
        target = own_positions[:, which.end] * (1 - share[:, None]) + there.positions[which.end] * share[:, None]
        far = float(np.linalg.norm(own_positions[first, which.end] - there.positions[which.end]))
        target[:, 1] += lift * min(1.0, far / 0.05)
        posture = forward_kinematics(skeleton, bent.root_positions, rotations)
        ahead = np.broadcast_to([0.0, 0.0, 1.0], target.shape).astype(np.float32)
        bend = quat_rotate(posture.orientations[:, which.upper], ahead)
        legs = reach_with_limb(skeleton, which, posture, target.astype(np.float32), bend=bend)
        rotations[:, list(which)] = legs
        posture = forward_kinematics(skeleton, bent.root_positions, rotations)
        goal_turns = np.broadcast_to(there.orientations[which.end], own_turns[:, which.end].shape)
        foot = quat_nlerp(own_turns[:, which.end], goal_turns, share[:, None])
        rotations[:, which.end] = quat_mul(quat_inv(posture.orientations[:, which.lower]), foot)
        if far > 0.012:
            contacts[lift > 1e-4, 2 * side : 2 * side + 2] = False
        settled = (share >= 1) & (there.positions[which.end][1] < 0.11)
        contacts[settled, 2 * side : 2 * side + 2] = True
    return Clip(skeleton, bent.frame_rate, bent.root_positions, rotations.astype(np.float32)), contacts


def _adjusting(count: int, begin: int, back: int, *, has_rise: bool, has_fall: bool) -> tuple[np.ndarray, np.ndarray]:
    """Share of the goal's foot place [T] and height of the lifted foot [T] [m]."""
    t = np.arange(count)
    share = _smooth((t - begin) / _ADJUST) if has_fall else np.ones(count, np.float32)
    lift = np.sin(np.pi * np.clip((t - begin) / _ADJUST, 0, 1)) if has_fall else np.zeros(count)
    if has_rise:
        share = share * (1 - _smooth((t - back) / _ADJUST))
        lift = lift + np.sin(np.pi * np.clip((t - back) / _ADJUST, 0, 1))
    return share, _LIFT * lift


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
    # The command to sit comes a little before the descent, the command to rise a little before the rise.
    switch = int(np.argmax(order >= down)) - int(rng.integers(0, 25))
    switch = max(switch, 0)
    rise = int(np.argmax(order >= span.last)) - int(rng.integers(20, 40)) if span.up is not None else count
    stand = int(np.argmax(order >= up)) if span.up is not None else count
    intent, at, horizon = np.full(count, WALK.column), np.full(count, -1), np.full(count, switch)
    intent[switch:rise], at[switch:rise] = ACTIONS[span.action].column, 0
    intent[rise:stand], at[rise:stand] = IDLE.column, 1
    horizon[stand:] = count - 1
    standing = Key(bent.root_positions[min(stand, count - 1)], bent.rotations[min(stand, count - 1)])
    return Episode(
        recording.name, bent, contacts, styles, phase, intent, at, horizon, ((goal, True), (standing, False))
    )
