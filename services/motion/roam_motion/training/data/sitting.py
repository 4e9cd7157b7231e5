"""Sitting episodes: a captured way down and a captured way up, brought to a new goal pose as people would do it.

Way down and way up may come from different clips: between them the goal pose is held. People lean forward, touch the
seat with their weight still over the feet, and only then settle back. So

- the hips' place and height change with the clip's own share of the descent, and they land so that the ankles are at
  most 0.30 m in front of them; what the goal pose wants beyond that is a slide back on the seat or a step out
  with the feet, after contact;
- trunk and arms are the clip's own until contact and go over into the goal pose in the 18-30 frames after it;
- feet whose place in the goal pose is another are set down there in the clip's own last step, or step once the seat
  carries the body;
- rising is the same the other way round: trunk, feet and hips leave the goal pose first, then the body rises.

Descents and rises that do not lean or balance as people do (captured on high stools, or bent too far) are left out.
"""

from dataclasses import dataclass, replace

import numpy as np
from roam_character.clip import Clip
from roam_character.kinematics import Limb, Posture, facing, forward_kinematics, limb, reach_with_limb
from roam_character.rotation import (
    quat_from_yaw,
    quat_inv,
    quat_mul,
    quat_nlerp,
    quat_rotate,
    quat_slerp,
    yaw_direction,
)
from roam_character.skeleton import Skeleton

from roam_motion.actions import IDLE, SIT, WALK
from roam_motion.animation.state import FRAME_RATE
from roam_motion.training.data.centre_of_mass import ahead_of_rear_ankle, lean
from roam_motion.training.data.episodes import Episode, labelled, smooth
from roam_motion.training.data.goals import LEGS, Bank, Key, aligned, ankles, key_yaw, new_goal
from roam_motion.training.data.recordings import Recording, Span

_FARTHEST = 0.30  # [m] ankles in front of the landing hips
_NEAREST = 0.16
_SETTLE = 18, 31  # frames from contact until the goal pose is taken
_STEP = 12  # frames of a step to or from the goal's place
_LIFT = 0.035  # [m] its height
_HELD = 20, 60  # frames held on either side of the middle
_LIVING = 0.15  # share of the clip's own motion that remains while held
_BEFORE, _AFTER = 80, 60  # frames of approach and of leaving that are kept
_COMMAND_DOWN = 9, 15  # frames from the command to sit until the descent
_COMMAND_UP = 2, 6  # frames from the command to rise until trunk or feet move
# [deg] largest forward lean of a captured descent, and of a rise, that is worth learning from: a network answers a
# little less than the mean of what it is shown, and people's medians are 49 and 42
_SOURCE_LEAN = 35.0, 33.0
_LEAST_LEAN = 28.0  # [deg] of an episode that is made of them
_LEAST_AHEAD = -0.05  # [m] centre of mass in front of the rear ankle, half-way
_STILL = 0.06  # [m] that feet move while a good source sinks or rises
_TALLER = 0.22  # [m] most that a seat differs from the captured one
_HANGING = 0.11  # [m] ankles of a goal pose above this do not stand on the floor
_STRIDE = 0.12  # [m] most that the clip's own last step is made longer or shorter
_SAME_PLACE = 0.012  # [m] feet nearer than this to their place do not step


@dataclass(frozen=True, eq=False)
class Passage:
    """One captured way down, or one way up read backwards: T frames from standing to being seated and on."""

    name: str
    hips: np.ndarray  # [T, 3]
    rotations: np.ndarray  # [T, J, 4]
    contacts: np.ndarray  # [T, 4] bool
    styles: np.ndarray  # [T, 4]
    turns: np.ndarray  # [T] gait phase per frame, as played forwards
    begins: int  # frame where the descent begins
    touches: int  # frame where the seat carries the body
    up: bool  # a way up, its frames in the reversed order

    def __len__(self) -> int:
        return len(self.hips)


@dataclass(frozen=True, eq=False)
class _Half:
    """A passage brought to the goal: T frames that end holding it."""

    hips: np.ndarray
    rotations: np.ndarray
    contacts: np.ndarray
    styles: np.ndarray
    turns: np.ndarray
    begins: int
    moves: int  # last frame (from the standing end) at which the goal pose is not yet taken
    touches: int


def passages(recording: Recording, span: Span, speed: float = 1.0, *, good: bool = True) -> list[Passage]:
    """The `good` (or all) ways down and up of one captured sit, at 30 Hz."""
    timed = recording.at_rate(FRAME_RATE, speed=speed)
    at = timed.spans[recording.spans.index(span)]
    contacts, styles, phase, _ = labelled(timed)
    clip, turns = timed.clip, np.diff(phase, prepend=phase[:1])
    out = []
    middle = (at.first + at.last) // 2
    ways = [(at.down, at.first, max(0, (at.down or 0) - _BEFORE), middle, 1)]
    ways += [(at.up, at.last, min(len(clip) - 1, (at.up or 0) + _AFTER), middle, -1)]
    for stands, touches, start, end, step in ways:
        if stands is None or abs(touches - stands) < 10 or abs(end - touches) < 2:
            continue
        pick = np.arange(start, end + step, step)
        marks = abs(stands - start), abs(touches - start)
        whole = Passage(timed.name, clip.root_positions, clip.rotations, contacts, styles, turns, *marks, up=step < 0)
        passage = _picked(whole, pick)
        least = _SOURCE_LEAN[passage.up]
        alike = not good or like_people(clip.skeleton, passage.hips, passage.rotations, *marks, least)
        if alike and (not good or _still(clip.skeleton, passage)):
            out.append(passage)
    return out


def like_people(
    skeleton: Skeleton,
    hips: np.ndarray,
    rotations: np.ndarray,
    begins: int,
    touches: int,
    least: float = _LEAST_LEAN,
) -> bool:
    """Whether a way down (or up, reversed) leans forward by `least` [deg] and keeps the body over the feet half-way."""
    cut = slice(max(begins - 10, 0), touches + 6)
    positions = forward_kinematics(skeleton, hips[cut], rotations[cut]).positions
    ahead = yaw_direction(facing(skeleton, positions))[:, [0, 2]]
    half = int(np.argmin(np.abs(positions[:, 0, 1] - (hips[begins, 1] + hips[touches, 1]) / 2)))
    leans = float(lean(skeleton, positions, ahead).max())
    over = float(ahead_of_rear_ankle(skeleton, positions, ahead)[half])
    return leans >= least and over >= _LEAST_AHEAD


def _still(skeleton: Skeleton, passage: Passage) -> bool:
    share = _share(passage)
    first = int(np.argmax(share > 0.15))
    cut = slice(first, passage.touches + 1)
    positions = forward_kinematics(skeleton, passage.hips[cut], passage.rotations[cut]).positions
    feet = positions[:, skeleton.indices(["leftFoot", "rightFoot"])]
    return float(np.linalg.norm(feet - feet[-1:], axis=-1).max()) < _STILL


def _share(passage: Passage) -> np.ndarray:
    """How much of the descent is over [T], never falling, 0 before it and 1 from contact on."""
    high, low = passage.hips[passage.begins, 1], passage.hips[passage.touches, 1]
    share = np.clip((high - passage.hips[:, 1]) / max(high - low, 1e-3), 0, 1)
    share[: passage.begins] = 0
    share[passage.touches :] = 1
    return np.maximum.accumulate(share)


def sitting(
    skeleton: Skeleton,
    down: Passage | None,
    up: Passage | None,
    bank: Bank,
    rng: np.random.Generator,
    *,
    good: bool = True,
) -> Episode | None:
    """An episode that sits down as `down` and rises as `up` (one of them may be missing) at a new goal pose; None
    where the goal does not suit them or, asked for a `good` one, makes them bend as people do not."""
    lead = down or up
    assert lead is not None
    key = _key(lead)
    goal = new_goal(skeleton, SIT.name, bank, key, rng)
    if any(abs(goal.hips[1] - _key(way).hips[1]) > _TALLER for way in (down, up) if way is not None):
        return None
    stretch = _stretch(skeleton, goal, key)
    slide = min(stretch, float(rng.uniform(0.04, 0.18)))
    goal = aligned(skeleton, goal, key, rng, by_feet=True)
    forward = _forward(skeleton, goal)
    # What neither the landing nor the slide covers, the feet step out by: they are that much nearer before.
    goal = Key((goal.hips + (stretch - slide) * forward).astype(np.float32), goal.rotations)
    halves: list[_Half | None] = []
    for way in (down, up):
        if way is None:
            halves.append(None)
            continue
        if way is not lead:
            slide = float(rng.uniform(0.02, 0.12))
            way = _moved(skeleton, way, goal, slide, rng)
        half = _to_goal(skeleton, way, goal, slide, rng)
        if good and not like_people(skeleton, half.hips, half.rotations, half.begins, half.touches):
            return None
        halves.append(half)
    return _joined(skeleton, lead.name, goal, halves[0], halves[1], rng)


def _forward(skeleton: Skeleton, key: Key) -> np.ndarray:
    """The direction on the floor [3] that a key pose faces."""
    return np.asarray(yaw_direction(np.asarray(key_yaw(skeleton, key), np.float32)))


def _key(way: Passage) -> Key:
    return Key(way.hips[way.touches], way.rotations[way.touches])


def _ahead(skeleton: Skeleton, key: Key) -> float:
    """How far the ankles are in front of the hips [m]."""
    forward = _forward(skeleton, key)
    return float((ankles(skeleton, key).mean(0) - key.hips) @ forward)


def _stretch(skeleton: Skeleton, goal: Key, key: Key) -> float:
    """How much farther the goal's feet are in front of its hips than where these land [m]."""
    wanted = _ahead(skeleton, goal)
    return max(wanted - float(np.clip(_ahead(skeleton, key), _NEAREST, _FARTHEST)), 0.0)


def _moved(skeleton: Skeleton, way: Passage, goal: Key, slide: float, rng: np.random.Generator) -> Passage:
    """A passage carried to the goal: its seated hips `slide` [m] in front of the goal's, facing alike."""
    key = _key(way)
    turn = key_yaw(skeleton, goal) - key_yaw(skeleton, key) + np.deg2rad(rng.normal() * 4)
    spin = quat_from_yaw(np.asarray(turn, np.float32))
    offset = np.append(rng.normal(size=2) * 0.02, 0.0)[[0, 2, 1]]
    pivot = np.array([key.hips[0], 0, key.hips[2]], np.float32)
    target = np.array([goal.hips[0], 0, goal.hips[2]], np.float32) + offset
    target = target + slide * _forward(skeleton, goal)
    hips = quat_rotate(np.broadcast_to(spin, (len(way), 4)), way.hips - pivot) + target
    rotations = way.rotations.copy()
    rotations[:, 0] = quat_mul(spin, rotations[:, 0])
    return replace(way, hips=hips.astype(np.float32), rotations=rotations.astype(np.float32))


def _picked(way: Passage, pick: np.ndarray) -> Passage:
    """The passage with frames `pick` [T] of all its tracks."""
    return replace(
        way,
        hips=way.hips[pick],
        rotations=way.rotations[pick],
        contacts=way.contacts[pick],
        styles=way.styles[pick],
        turns=way.turns[pick],
    )


def _to_goal(skeleton: Skeleton, way: Passage, goal: Key, slide: float, rng: np.random.Generator) -> _Half:
    """The passage bent to the goal, and held there for a while."""
    settle = int(rng.integers(*_SETTLE))
    hold = settle + 2 * _STEP + int(rng.integers(*_HELD))
    way = _lengthened(way, way.touches + hold)
    key, share, since = _key(way), _share(way), np.arange(len(way)) - way.touches
    taken = smooth(since / settle)[:, None]
    forward = _forward(skeleton, goal)
    landing = goal.hips - key.hips + slide * forward * np.array([1, 0, 1], np.float32)
    lives = _LIVING * smooth((hold - 12 - since) / 12)[:, None]
    held = goal.hips + lives * (way.hips - key.hips)
    hips = (1 - taken) * (way.hips + share[:, None] * landing) + taken * held
    rotations = _turned(skeleton, way, key, goal, share, taken, lives)
    bent = Clip(skeleton, float(FRAME_RATE), hips.astype(np.float32), rotations.astype(np.float32))
    rotations, contacts, stepped = _feet(skeleton, way, bent, goal, settle, rng)
    moves = max(way.touches + settle, stepped)
    return _Half(bent.root_positions, rotations, contacts, way.styles, way.turns, way.begins, moves, way.touches)


def _lengthened(way: Passage, last: int) -> Passage:
    """With frames up to `last`: the seated ones there and back, as often as need be."""
    count, first = len(way), way.touches + 1
    extra = np.concatenate([np.arange(count - 2, first - 1, -1), np.arange(first, count)])
    pick = np.arange(count)
    while len(pick) <= last:
        pick = np.append(pick, extra if len(extra) else [count - 1])
    pick = pick[: last + 1]
    return _picked(way, pick)


def _turned(
    skeleton: Skeleton,
    way: Passage,
    key: Key,
    goal: Key,
    share: np.ndarray,
    taken: np.ndarray,
    lives: np.ndarray,
) -> np.ndarray:
    """Local rotations [T, J, 4]: the clip's own, its heading turned with the descent, going over into the goal's."""
    own = way.rotations.copy()
    turn = key_yaw(skeleton, goal) - key_yaw(skeleton, key)
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    own[:, 0] = quat_mul(quat_from_yaw((share * turn).astype(np.float32)), own[:, 0])
    identity = np.zeros_like(own)
    identity[..., 3] = 1
    living = quat_slerp(identity, quat_mul(quat_inv(key.rotations), way.rotations), lives[..., None].astype(np.float32))
    held = quat_mul(np.broadcast_to(goal.rotations, own.shape), living)
    return np.asarray(quat_slerp(own, held, taken[..., None].astype(np.float32)))


def _feet(
    skeleton: Skeleton, way: Passage, bent: Clip, goal: Key, settle: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, int]:
    """Legs by IK: local rotations, contacts, and the frame by which both feet are where the goal has them."""
    own = forward_kinematics(skeleton, way.hips, way.rotations)
    there = forward_kinematics(skeleton, goal.hips, goal.rotations)
    rotations, contacts, t = bent.rotations.copy(), way.contacts.copy(), np.arange(len(way))
    gap, merges, stepped = int(rng.integers(6, 14)), rng.random() < 0.6, way.touches
    late = way.touches + int(rng.integers(-3, max(settle - _STEP, 2)))
    for turn, side in enumerate(rng.permutation(2)):
        which = limb(skeleton, LEGS[side])
        far = float(np.linalg.norm(own.positions[way.touches, which.end] - there.positions[which.end]))
        begin, frames = late + turn * gap, _STEP
        stands = bool(there.positions[which.end][1] < _HANGING)
        swing = _last_swing(way, 2 * side) if merges and far < _STRIDE and stands else None
        if swing is not None:
            begin, frames = swing
        share = smooth((t - begin) / frames)[:, None]
        target = own.positions[:, which.end] * (1 - share) + there.positions[which.end] * share
        if swing is None and far > _SAME_PLACE:
            lift = np.sin(np.pi * np.clip((t - begin) / frames, 0, 1))
            target[:, 1] += _LIFT * lift * min(1.0, far / 0.05)
            contacts[lift > 1e-4, 2 * side : 2 * side + 2] = False
            stepped = max(stepped, begin + frames)
        _leg_reaches(skeleton, bent, rotations, which, target, own, there, share)
        contacts[t >= max(begin + frames, way.touches), 2 * side : 2 * side + 2] = stands
    return rotations.astype(np.float32), contacts, stepped


def _last_swing(way: Passage, column: int) -> tuple[int, int] | None:
    """Begin and length of the last time before the descent that a foot was in the air; None when it was not."""
    down = way.contacts[: way.begins + 1, column]
    if not down[-1] or down.all():
        return None
    end = int(np.flatnonzero(~down)[-1]) + 1
    begin = int(np.flatnonzero(down[:end])[-1]) + 1 if down[:end].any() else 0
    return (begin, end - begin) if 6 <= end - begin <= 30 else None


def _leg_reaches(
    skeleton: Skeleton,
    bent: Clip,
    rotations: np.ndarray,
    leg: Limb,
    target: np.ndarray,
    own: Posture,
    there: Posture,
    share: np.ndarray,
) -> None:
    """Brings one ankle to `target` [T, 3] and its foot between its own and the goal's orientation, in place."""
    posture = forward_kinematics(skeleton, bent.root_positions, rotations)
    ahead = np.broadcast_to([0.0, 0.0, 1.0], target.shape).astype(np.float32)
    bend = quat_rotate(posture.orientations[:, leg.upper], ahead)
    rotations[:, list(leg)] = reach_with_limb(skeleton, leg, posture, target.astype(np.float32), bend=bend)
    posture = forward_kinematics(skeleton, bent.root_positions, rotations)
    turns = own.orientations[:, leg.end]
    foot = quat_nlerp(turns, np.broadcast_to(there.orientations[leg.end], turns.shape), share.astype(np.float32))
    rotations[:, leg.end] = quat_mul(quat_inv(posture.orientations[:, leg.lower]), foot)


def _joined(
    skeleton: Skeleton, name: str, goal: Key, down: _Half | None, up: _Half | None, rng: np.random.Generator
) -> Episode:
    """The episode: down, held, up, with commands and goals."""
    parts: list[_Half] = [half for half in (down, up) if half is not None]
    before = len(down.hips) if down is not None else 0

    def whole(field: str) -> np.ndarray:
        tracks = [getattr(half, field)[:: -1 if half is up else 1] for half in parts]
        return np.concatenate(tracks)

    count = len(whole("hips"))
    turns = whole("turns")
    turns[max(before - 1, 0) : before + 1] = 1 / (4.0 * FRAME_RATE)
    command, told, stands = 0, count, count
    if down is not None:
        command = max(down.begins - int(rng.integers(*_COMMAND_DOWN)), 0)
    if up is not None:
        told = count - 1 - up.moves - int(rng.integers(*_COMMAND_UP))
        stands = count - 1 - up.begins
    intent, at, horizon = np.full(count, WALK.column), np.full(count, -1), np.full(count, command)
    intent[command:told], at[command:told] = SIT.column, 0
    intent[told:stands], at[told:stands] = IDLE.column, 1
    horizon[stands:] = count - 1
    clip = Clip(skeleton, float(FRAME_RATE), whole("hips"), whole("rotations"))
    end = min(stands, count - 1)
    standing = Key(clip.root_positions[end], clip.rotations[end])
    return Episode(
        name,
        clip,
        whole("contacts"),
        whole("styles"),
        np.cumsum(np.maximum(turns, 0)).astype(np.float32),
        intent,
        at,
        horizon,
        ((goal, True), (standing, False)),
    )
