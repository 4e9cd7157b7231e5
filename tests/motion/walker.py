"""A stand-in animator for the tests of sessions, pacing and transports: it slides, and it remembers its batches."""

import threading
from dataclasses import dataclass, field

import numpy as np
import orjson
from roam_character.kinematics import forward_kinematics
from roam_character.skeleton import humanoid_skeleton
from roam_character.wire import snorm16
from roam_motion.animator import FrameData, Goal, Idle, Steer

SPEED = 0.05  # [m] per frame towards a goal


@dataclass(frozen=True)
class Place:
    """Where the character is; `seed` shifts it a little so that sessions differ."""

    position: tuple[float, float]
    seed: int

    @property
    def place(self):
        return self.position

    def split(self):
        return orjson.dumps([self.position, self.seed]), None

    @staticmethod
    def joined(data, volume):
        assert volume is None
        position, seed = orjson.loads(data)
        return Place(tuple(position), seed)


@dataclass
class Walker:
    """Implements `StepsCharacters` without a network."""

    batches: list[int] = field(default_factory=list)
    gate: threading.Event | None = None  # when set, every step waits for it
    poisoned_seed: int | None = None  # a session with this seed fails

    skeleton = humanoid_skeleton()

    def start(self, position_xz, yaw, seed):
        x, z = position_xz
        return Place((x, z), seed)

    def warmed(self):
        return self

    def step(self, states, intents):
        if self.gate is not None:
            self.gate.wait()
        if any(state.seed == self.poisoned_seed for state in states):
            raise ArithmeticError("poisoned")
        self.batches.append(len(states))
        return [self._one(state, intent) for state, intent in zip(states, intents, strict=True)]

    def _one(self, state, intent):
        rest = self.skeleton
        rotations = rest.rest_rotations.astype(np.float32)
        x, z = state.position
        action, distance = "idle", None
        if isinstance(intent, Steer):
            x, z = x + float(intent.velocity[0]) / 30, z + float(intent.velocity[1]) / 30
            action = "walk"
        elif isinstance(intent, Goal):
            gap = intent.pose.root_position[[0, 2]] - (x, z)
            length = float(np.linalg.norm(gap))
            x, z = np.array([x, z]) + gap * min(1.0, SPEED / max(length, 1e-9))
            arrived = length <= SPEED
            action, distance = (intent.action if arrived else "walk"), max(0.0, length - SPEED)
            if arrived:
                rotations = intent.pose.rotations
        else:
            assert isinstance(intent, Idle)
        root = np.array([x, rest.rest_offsets[0][1], z], np.float32)
        positions, _ = forward_kinematics(rest, root, rotations)
        frame = FrameData(
            root=np.concatenate([root, rotations[0]]),
            rotations=rotations,
            snorm16=snorm16(rotations),
            positions=positions,
            contacts=np.array([True, False, True, False]),
            action=action,
            goal_distance=distance,
        )
        return Place((float(x), float(z)), state.seed), frame
