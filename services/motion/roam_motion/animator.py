"""The application object of the motion domain: start characters, step many of them in one batch."""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from roam_character.volume import Volume
from roam_serving.monitoring.logs import get_log
from torch import Tensor

from roam_motion.actions import ACTIONS, IDLE, STYLES, action_numbered
from roam_motion.animation.blending import Blending
from roam_motion.animation.collision import Furniture, furniture_of, near
from roam_motion.animation.figure import CONTACT_JOINTS, Figure, humanoid_figure
from roam_motion.animation.manner import drawn
from roam_motion.animation.rows import split_array
from roam_motion.animation.shown.living import life_row
from roam_motion.animation.state import FUTURE, PAST, Characters, shapes_of
from roam_motion.control.actions import transition
from roam_motion.control.controller import INTERACT, Body, Control, control
from roam_motion.control.intent import Goal, Idle, Intent, Steer
from roam_motion.control.planner import Plan
from roam_motion.control.seat import Seat, resting
from roam_motion.graphs import Graphs, Shown
from roam_motion.models.registry import MotionModel, load_model

__all__ = ["Animator", "CharacterState", "FrameData", "Goal", "Idle", "Intent", "Steer"]

log = get_log("roam_motion.animator")

_LONG = 3600.0  # [s] range in which the living idle begins
_HELD = 0.999  # settledness from which nothing is pushed out of the furniture any more
_SEAT_FIELDS = ("positions", "orientations", "root", "stand")
_MARK = b"ROAM\x08"
# Mark; mode, since, waiting, seat, numbers of the row and of the depths; plan, clock, along, pace.
_HEAD = struct.Struct("<5s6i9d")
_COMPANY = 21  # characters that are tried: some of a padded batch, at odd places of whole vectors
_TRIED: tuple[Intent, ...] = (
    Steer(np.array([0.4, 1.1], np.float32), np.array([0.8, 0.6], np.float32)),
    Idle(look_at=np.array([2.0, 1.4, 1.0], np.float32)),
    Steer(np.array([-0.7, 0.2], np.float32)),
)
_NO_SEAT = 0  # in the head, where else the number of the seat's action is


@dataclass(frozen=True, eq=False)
class CharacterState:
    """One character between two frames: plain numbers."""

    row: np.ndarray  # [D] its row of `Characters`
    control: Control

    @property
    def place(self) -> tuple[float, float]:
        """Where it is on the floor: x, z [m] of the hips."""
        x, _, z = split_array(self.row[None], shapes_of(len(self.row)))["hips"][0].tolist()
        return x, z

    def to_bytes(self) -> bytes:
        """Exact serialised form: a head; the row, the seat and its depths as float32; the furniture's volume."""
        head, volume = self.split()
        return head + (volume.packed if volume else b"")

    def split(self) -> tuple[bytes, Volume | None]:
        """The same in two: what changes from frame to frame, and the furniture, which many states share.

        A server writes thousands a minute.
        """
        memory, seat = self.control, self.control.seat
        parts, volume, kind = [self.row], None, _NO_SEAT
        if seat is not None:
            parts += [getattr(seat, name) for name in _SEAT_FIELDS]
            kind = ACTIONS[seat.action].number
            if seat.volume is not None and seat.depths is not None:
                parts.append(seat.depths)
                volume = seat.volume
        depths = len(parts[-1]) if volume else 0
        times = memory.clock, memory.along, memory.pace
        integers = memory.mode, memory.since, memory.waiting, kind, len(self.row), depths
        head = _HEAD.pack(_MARK, *integers, *memory.plan, *times)
        return head + b"".join(part.astype("<f4").tobytes() for part in parts), volume

    @staticmethod
    def joined(head: bytes, volume: Volume | None) -> "CharacterState":
        """The state that `split` took apart. ValueError when the bytes are something else."""
        return CharacterState.from_bytes(head + (volume.packed if volume else b""))

    @staticmethod
    def from_bytes(data: bytes) -> "CharacterState":
        """The state that `to_bytes` wrote. ValueError when the bytes are something else."""
        if len(data) < _HEAD.size or not data.startswith(_MARK):
            raise ValueError("not a character state")
        _, mode, since, waiting, kind, width, depths, *plan, clock, along, pace = _HEAD.unpack_from(data)
        joints = shapes_of(width)["velocities"][0]
        count = width + (0 if kind == _NO_SEAT else 12 * joints + 8 + depths)
        if len(data) < _HEAD.size + 4 * count:
            raise ValueError("a character state that was cut short")
        numbers = np.frombuffer(data, "<f4", count, _HEAD.size).astype(np.float32)
        tail, seat = data[_HEAD.size + 4 * count :], None
        if bool(tail) != bool(depths):
            raise ValueError("a character state of another length than it says")
        if kind != _NO_SEAT:
            action = action_numbered(kind)
            if action is None:
                raise ValueError(f"a character state with action {kind}, which this build does not know")
            seat = _seat(numbers[width:], joints, action.name, Volume.unpacked(tail) if tail else None)
        return CharacterState(numbers[:width], Control(Plan(*plan), mode, seat, since, waiting, clock, along, pace))


def _seat(numbers: np.ndarray, joints: int, action: str, volume: Volume | None) -> Seat:
    """From its numbers [12 J + 8 + P] in the order of `_SEAT_FIELDS`, then the depths."""
    ends = [3 * joints, 12 * joints, 12 * joints + 4, 12 * joints + 8]
    positions, orientations, root, stand, depths = np.split(numbers, ends)
    shaped = positions.reshape(-1, 3), orientations.reshape(-1, 3, 3)
    return Seat(action, *shaped, root, stand, volume, depths if volume is not None else None)


@dataclass(frozen=True, eq=False)
class FrameData:
    """One frame to show."""

    root: np.ndarray  # [7] hips [m], their rotation xyzw
    rotations: np.ndarray  # [J, 4] local, xyzw
    snorm16: np.ndarray  # [J, 4] int16, the same as streams send them
    positions: np.ndarray  # [J, 3] [m]
    contacts: np.ndarray  # [4] bool
    action: str
    goal_distance: float | None  # mean joint distance to the goal pose [m], while sitting or lying down on it

    @property
    def root_position(self) -> np.ndarray:
        """Of the hips [3] [m]."""
        return self.root[:3]


class Animator:
    """A motion model at work; stateless between calls, so one serves every session.

    `blending` is the model's own unless an evaluation leaves something out.
    """

    def __init__(self, model: MotionModel, blending: Blending | None = None) -> None:
        self._model, self._blending = model, blending or model.blending
        self._in_company = True  # see `warmed`

    @property
    def figure(self) -> Figure:
        """The skeleton."""
        return self._model.figure

    @cached_property
    def _graphs(self) -> Graphs:
        """Made for the first step: a server that steps elsewhere only starts characters."""
        return Graphs(self.figure, self._model.predictor(), self._blending)

    @staticmethod
    def load(weights: str | Path, blending: Blending | None = None) -> "Animator":
        """From a .safetensors file. ValueError when its model is not known, or made for another skeleton."""
        return Animator(load_model(weights, humanoid_figure()), blending)

    def start(self, position_xz: Sequence[float], yaw: float, seed: int = 0) -> CharacterState:
        """A character standing quietly at a place [m] with a heading [rad]; the seed picks stance and gait phase."""
        rng = np.random.default_rng(seed)
        pick = int(rng.integers(len(self._model.starts["height"])))
        turn = torch.tensor(
            [[math.cos(yaw), 0, math.sin(yaw)], [0, 1, 0], [-math.sin(yaw), 0, math.cos(yaw)]], dtype=torch.float32
        )
        orientations = (turn @ self._model.starts["orientations"][pick])[None]
        x, z = float(position_xz[0]), float(position_xz[1])
        hips = torch.tensor([[x, float(self._model.starts["height"][pick]), z]])
        batch = _standing(self.figure, hips, orientations, float(rng.random()), drawn(seed))
        return CharacterState(batch.rows()[0].numpy(), Control(Plan(x, z, yaw=yaw), clock=_LONG * float(rng.random())))

    def warmed(self) -> "Animator":
        """Itself, after first steps, which are slow: let no client wait for them.

        A frame must not depend on who else is in its batch. The elementary functions see to that by themselves; what
        else rounds, products of matrices above all, is the processor's libraries' choice. So company is tried before it
        is trusted: where some characters' bits differ alone and together, every one is stepped by itself from then on.
        """
        states = [self.start((0.3 * k, -0.2 * k), 0.7 * k, k) for k in range(_COMPANY)]
        intents = [_TRIED[k % len(_TRIED)] for k in range(_COMPANY)]
        alone = [self._stepped([one], [intent])[0][0] for one, intent in zip(states, intents, strict=True)]
        together = [state for state, _ in self._stepped(states, intents)]
        self._in_company = all(np.array_equal(a.row, b.row) for a, b in zip(alone, together, strict=True))
        if not self._in_company:
            log.warning("on this processor bits depend on company, so characters are stepped one by one, slowly")
        return self

    def step(
        self, states: Sequence[CharacterState], intents: Sequence[Intent]
    ) -> list[tuple[CharacterState, FrameData]]:
        """The next frame of every character, in one batch where that changes no bit."""
        if self._in_company:
            return self._stepped(states, intents) if states else []
        return [self._stepped([state], [intent])[0] for state, intent in zip(states, intents, strict=True)]

    @torch.inference_mode()
    def _stepped(
        self, states: Sequence[CharacterState], intents: Sequence[Intent]
    ) -> list[tuple[CharacterState, FrameData]]:
        rows = np.stack([state.row for state in states])
        bodies = [
            Body(x, z, math.atan2(dx, dz), height, (a, b), tuple(manner))
            for x, z, dx, dz, height, a, b, *manner in self._graphs.bodies(rows)
        ]
        memories, goals = control(self.figure, [state.control for state in states], intents, bodies)
        if not self._blending.settling:
            goals.fields["urgency"][:] = 0.0
        life = _life(self.figure, memories, intents)
        settled = split_array(rows, shapes_of(rows.shape[1]))["settled"]
        shown = self._graphs.step(rows, goals.rows, life, _around(self.figure, memories, bodies, settled))
        frames = _frames(self.figure, shown, memories)
        after = [CharacterState(row.copy(), memory) for row, memory in zip(shown.rows, memories, strict=True)]
        return list(zip(after, frames, strict=True))


def _frames(figure: Figure, shown: Shown, memories: Sequence[Control]) -> list[FrameData]:
    """One of each; those who take or hold a goal pose tell how far it is."""
    told = [
        _told(figure, memory, *of_each)
        for memory, *of_each in zip(memories, shown.style, shown.positions, shown.apart, strict=True)
    ]
    numbers = (shown.root, shown.rotations, shown.snorm16, shown.positions, shown.contacts > 0)
    return [FrameData(*parts, *labels) for *parts, labels in zip(*numbers, told, strict=True)]


def _life(figure: Figure, memories: Sequence[Control], intents: Sequence[Intent]) -> np.ndarray:
    """What the living idle is told: a row of `Life` for every character [B, D]."""
    rows = []
    for memory, intent in zip(memories, intents, strict=True):
        seat = memory.seat if memory.mode == INTERACT else None
        rows.append(life_row(memory.clock, resting(figure, seat) if seat else (0.0, 0.0, 0.0), intent.look_at))
    return np.stack(rows)


def _told(
    figure: Figure, memory: Control, style: float, positions: np.ndarray, apart: float
) -> tuple[str, float | None]:
    """The action that a frame shows, and the mean joint distance to the goal pose [m], if there is one.

    `apart` is from the pose asked of the model, which on a planned way is another one.
    """
    name = STYLES[int(style)]
    if memory.mode != INTERACT or memory.seat is None:
        return name, None
    if ACTIONS[memory.seat.action].style == name:
        name = memory.seat.action
    if transition(figure, memory.seat):
        return name, float(np.linalg.norm(positions - memory.seat.positions, axis=-1).mean())
    return name, float(apart)


def _around(
    figure: Figure, controls: Sequence[Control], bodies: Sequence[Body], settled: np.ndarray
) -> tuple[Tensor, Furniture] | None:
    """The rows of characters that can touch their goal's furniture, and it; not of those who hold their goal pose."""
    rows, volumes, allowed, onto = [], [], [], []
    for row, (memory, body) in enumerate(zip(controls, bodies, strict=True)):
        seat = memory.seat
        if seat is None or seat.volume is None or seat.depths is None or settled[row] > _HELD:
            continue
        if not near(figure, seat.volume, body.x, body.z):
            continue
        rows.append(row)
        volumes.append(seat.volume)
        allowed.append(seat.depths)
        onto.append(memory.along > 0)
    return (torch.tensor(rows), furniture_of(volumes, allowed, onto)) if rows else None


def _standing(figure: Figure, hips: Tensor, orientations: Tensor, phase: float, manner: np.ndarray) -> Characters:
    """A batch of one that has stood still for a second."""
    positions = figure.positions(hips, orientations)
    frame = figure.frame(positions)
    row = torch.cat(
        [frame.origin, frame.direction, torch.tensor([[*(float(style == IDLE.style) for style in STYLES), phase]])], 1
    )
    planted = torch.ones(1, len(CONTACT_JOINTS))
    return Characters(
        hips=hips,
        orientations=orientations,
        velocities=torch.zeros_like(positions),
        past=row[:, None].expand(-1, PAST, -1).clone(),
        future=row[:, None].expand(-1, FUTURE, -1).clone(),
        contacts=planted,
        locks=positions[:, figure.contacts],
        lock_weights=planted.clone(),
        settled=torch.zeros(1),
        blend=torch.zeros(1),
        standing=torch.zeros(1),
        steps=torch.zeros(1, 2),
        manner=torch.from_numpy(manner)[None],
        gaze=torch.zeros(1, 3),
        linger=torch.zeros(1, 3),
    )
