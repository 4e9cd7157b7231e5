"""What computes frames: this process, or a worker process of its own, so that stepping and sending never wait for
each other.

In one process they share the interpreter's lock: with 60 readers a step that computes for 17 ms waits for another ten.
Between the processes travels what the other side does not have yet. An intent crosses once; a state goes back only when
it is not the one that the process made last, a seat with its furniture only when it is new. What the server holds is
always whole: a process that dies is started anew and goes on from the same states, to the same bits.
"""

import hashlib
import multiprocessing
import pickle
import platform
import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import roam_character
import torch
from roam_serving.collector import spare_collector
from roam_serving.monitoring.logs import get_log

from roam_motion.animator import Animator, CharacterState, FrameData, Intent
from roam_motion.control.controller import Control
from roam_motion.control.planner import Plan
from roam_motion.control.seat import Seat
from roam_motion.session.object_copies import Changes, Copies, Originals

log = get_log("roam_motion.session.worker")

_CPUINFO = Path("/proc/cpuinfo")
_CODE = Path(__file__).parents[1], Path(roam_character.__file__).parent
_LONGEST = 20.0  # [s] for an answer; a step of 256 characters takes 0.03
_START = 120.0  # [s] a cold start on a busy machine; normally three

Step = Callable[[Sequence[CharacterState], Sequence[Intent]], list[tuple[CharacterState, FrameData]]]

Result = tuple[CharacterState, FrameData] | Exception

# States and, for each, the intents of its next frames -> for each its frames in order; where one fails, its error last.
Frames = Callable[[Sequence[CharacterState], Sequence[Sequence[Intent]]], Sequence[Sequence[Result]]]

Load = Callable[[Path], Step]  # makes what steps; a module's own function, so that it travels


class CulpritError(RuntimeError):
    """A character at which the process that steps dies every time."""


def frames_of(
    step: Step, states: Sequence[CharacterState], intents: Sequence[Sequence[Intent]]
) -> Sequence[Sequence[Result]]:
    """`Frames` by one batched `step` after the other; all characters have equally many intents."""
    results: list[list[Result]] = [[] for _ in states]
    going = dict(enumerate(states))
    for frame in range(len(intents[0]) if intents else 0):
        stepped = _step_all(step, list(going.values()), [intents[index][frame] for index in going])
        for index, result in zip(list(going), stepped, strict=True):
            results[index].append(result)
            if isinstance(result, Exception):
                del going[index]
            else:
                going[index] = result[0]
    return results


def _step_all(step: Step, states: Sequence[CharacterState], intents: Sequence[Intent]) -> Sequence[Result]:
    try:
        return step(states, intents)
    except Exception as error:
        if len(states) == 1:
            return [error]
        return [_step_all(step, [state], [intent])[0] for state, intent in zip(states, intents, strict=True)]


def load_step(weights: Path) -> Step:
    """An animator's step, warm."""
    return Animator.load(weights).warmed().step


@dataclass(frozen=True)
class _Request:
    """Characters to step, as numbers."""

    new_states: Changes[CharacterState]
    new_intents: Changes[Intent]
    states: list[int]
    intents: list[list[int]]  # of every character those of its next frames
    made: Sequence[int]  # what the states of all frames will be called, character by character
    alone: bool  # step one character after the other, and tell which


@dataclass(frozen=True)
class _Answer:
    """N frames of all characters, one behind the other."""

    counts: list[int]  # of every character how many
    errors: dict[int, Exception]  # by character: what came instead of a further one
    new_seats: Changes[Seat]
    seats: list[int | None]  # [N]
    rows: np.ndarray  # [N, D]
    controls: np.ndarray  # [N, 12] the rest of `Control`
    frames: tuple[np.ndarray, ...]  # the arrays of FrameData, each [N, …]
    actions: list[str]
    gaps: list[float | None]


class WorkerProcess:
    """One process that steps; `frames` blocks and is for one thread at a time."""

    def __init__(self, weights: Path, *, torch_threads: int = 1, load: Load = load_step) -> None:
        self._arguments = weights, torch_threads, load
        self._context = multiprocessing.get_context("spawn")  # a fork would copy torch's threads half
        self._current = self._context.Value("i", 0, lock=False)  # which character is stepped alone
        self._closed = False
        self._launch()

    @property
    def pid(self) -> int:
        """Of the worker process now."""
        assert self._process.pid is not None
        return self._process.pid

    def frames(
        self, states: Sequence[CharacterState], intents: Sequence[Sequence[Intent]]
    ) -> Sequence[Sequence[Result]]:
        """`Frames`. RuntimeError when the process has died and cannot be started anew."""
        try:
            return self._link.frames(states, intents)
        except (EOFError, OSError):
            self._revive()
            return self._without_culprits(states, intents)

    def _without_culprits(
        self, states: Sequence[CharacterState], intents: Sequence[Sequence[Intent]]
    ) -> Sequence[Sequence[Result]]:
        """Frames of a batch in which the process died: one character alone after the other, the same bits.

        One at which it dies again gets an error instead of frames, and the others go on without it.
        """
        culprits: dict[int, Result] = {}
        while True:
            going = [index for index in range(len(states)) if index not in culprits]
            try:
                results = self._link.frames([states[i] for i in going], [intents[i] for i in going], alone=True)
            except (EOFError, OSError):
                culprit = going[self._current.value] if self._current.value < len(going) else going[0]
                culprits[culprit] = CulpritError("the worker process dies at this character")
                self._revive()
                continue
            found = dict(zip(going, results, strict=True))
            return [[culprits[index]] if index in culprits else found[index] for index in range(len(states))]

    def _revive(self) -> None:
        if self._closed:
            raise RuntimeError("the worker process has been closed")
        self._process.kill()  # it may hang instead
        self._process.join()
        log.error("the worker process has died and is started anew", code=self._process.exitcode)
        self._launch()

    def close(self) -> None:
        """Ends the process at once."""
        self._closed = True
        self._process.kill()
        self._process.join()

    def _launch(self) -> None:
        pipe, theirs = self._context.Pipe()
        self._process = self._context.Process(
            target=_serve, args=(theirs, self._current, *self._arguments), daemon=True
        )
        self._process.start()
        theirs.close()  # so that ours ends with the process
        if not pipe.poll(_START):
            self.close()
            raise RuntimeError("the worker process did not start in time")
        _receive(pipe)
        self._link = _WorkerLink(pipe)


class _WorkerLink:
    """The server's side of one life of the process."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._states: Originals[CharacterState] = Originals()
        self._intents: Originals[Intent] = Originals()
        self._seats: Copies[Seat] = Copies()

    def frames(
        self, states: Sequence[CharacterState], intents: Sequence[Sequence[Intent]], alone: bool = False
    ) -> Sequence[Sequence[Result]]:
        """Asks and waits. EOFError or OSError when the process is gone, or does not answer for long."""
        if not states:
            return []
        called = [self._states.number(state) for state in states]
        wanted = [[self._intents.number(intent) for intent in of_one] for of_one in intents]
        made = self._states.reserve(sum(map(len, wanted)))
        request = _Request(self._states.changes(), self._intents.changes(), called, wanted, made, alone)
        self._pipe.send_bytes(pickle.dumps(request))
        if not self._pipe.poll(_LONGEST):
            raise TimeoutError("the worker process does not answer")
        return self._results(_receive(self._pipe), made)

    def _results(self, answer: _Answer, made: Sequence[int]) -> Sequence[Sequence[Result]]:
        self._seats.take(answer.new_seats)
        seats = [None if number is None else self._seats[number] for number in answer.seats]
        states = list(map(_state, answer.rows, answer.controls.tolist(), seats))
        self._states.adopt(states, made)
        frames = map(FrameData, *answer.frames, answer.actions, answer.gaps)
        pairs = zip(states, frames, strict=True)
        results: list[list[Result]] = [list(islice(pairs, count)) for count in answer.counts]
        for character, error in answer.errors.items():
            results[character].append(error)
        return results


def _receive(pipe: Connection) -> Any:
    """The next message, raised where it is an error."""
    answer = pickle.loads(pipe.recv_bytes())
    if isinstance(answer, Exception):
        raise answer
    return answer


def _serve(pipe: Connection, current: Any, weights: Path, torch_threads: int, load: Load) -> None:
    """In the process: one request after the other, until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the server decides what ends when
    torch.set_num_threads(torch_threads)
    try:
        worker = _Worker(load(weights), current)
    except Exception as error:
        pipe.send_bytes(_pickled(error))
        return
    spare_collector()
    pipe.send_bytes(_pickled(None))
    with suppress(EOFError):
        while True:
            pipe.send_bytes(_pickled(worker.answer(pickle.loads(pipe.recv_bytes()))))


def _pickled(message: object) -> bytes:
    """A message, or where it is an error that cannot travel its text."""
    try:
        return pickle.dumps(message)
    except Exception as error:
        return pickle.dumps(RuntimeError(f"{message!r} ({error})"))


class _Worker:
    """The step, with the states and intents that may be asked for again."""

    def __init__(self, step: Step, current: Any) -> None:
        self._step, self._current = step, current
        self._states: Copies[CharacterState] = Copies()
        self._intents: Copies[Intent] = Copies()
        self._seats: Originals[Seat] = Originals()

    def answer(self, request: _Request) -> _Answer:
        """The frames that were asked for."""
        self._states.take(request.new_states)
        self._intents.take(request.new_intents)
        states = [self._states[number] for number in request.states]
        intents = [[self._intents[number] for number in of_one] for of_one in request.intents]
        results = self._alone(states, intents) if request.alone else frames_of(self._step, states, intents)
        errors = {i: of_one[-1] for i, of_one in enumerate(results) if isinstance(of_one[-1], Exception)}
        pairs = [[pair for pair in of_one if not isinstance(pair, Exception)] for of_one in results]
        made = [pair for of_one in pairs for pair in of_one]
        self._states.keep([state for state, _ in made], request.made)
        return self._packed([len(of_one) for of_one in pairs], errors, made)

    def _alone(
        self, states: Sequence[CharacterState], intents: Sequence[Sequence[Intent]]
    ) -> Sequence[Sequence[Result]]:
        results: list[Sequence[Result]] = []
        for self._current.value, pair in enumerate(zip(states, intents, strict=True)):
            results += frames_of(self._step, [pair[0]], [pair[1]])
        return results

    def _packed(
        self, counts: list[int], errors: dict[int, Exception], made: Sequence[tuple[CharacterState, FrameData]]
    ) -> _Answer:
        if not made:
            nothing = np.zeros((0, 0), np.float32)
            return _Answer(counts, errors, self._seats.changes(), [], nothing, nothing, (nothing,) * 5, [], [])
        controls = [state.control for state, _ in made]
        seats = [None if control.seat is None else self._seats.number(control.seat) for control in controls]
        frames = [frame for _, frame in made]
        arrays = zip(*(_arrays(frame) for frame in frames), strict=True)
        return _Answer(
            counts=counts,
            errors=errors,
            new_seats=self._seats.changes(),
            seats=seats,
            rows=np.stack([state.row for state, _ in made]),
            controls=np.array([_numbers(control) for control in controls]),
            frames=tuple(np.stack(part) for part in arrays),
            actions=[frame.action for frame in frames],
            gaps=[frame.goal_distance for frame in frames],
        )


def _arrays(frame: FrameData) -> tuple[np.ndarray, ...]:
    return frame.root, frame.rotations, frame.snorm16, frame.positions, frame.contacts


def _numbers(control: Control) -> tuple[float, ...]:
    """All of a `Control` but its seat."""
    plan, mode, _, *rest = control
    return *plan, mode, *rest


def _state(row: np.ndarray, numbers: Sequence[float], seat: Seat | None) -> CharacterState:
    *plan, mode, since, waiting, clock, along, pace = numbers
    control = Control(Plan(*plan), int(mode), seat, int(since), int(waiting), clock, along, pace)
    return CharacterState(row.copy(), control)


def build_name(weights: str, code: Sequence[Path] = _CODE) -> str:
    """A name that is equal where frames are equal bit for bit.

    What decides a frame's last bits besides the session: the network (`weights` names it), the sources in the folders
    `code`, torch, and the kind of processor.
    """
    parts = (weights, _sources(code), torch.__version__, platform.system(), platform.machine(), _processor())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _sources(folders: Sequence[Path]) -> str:
    """A step written in another way rounds otherwise, so replicas of two versions do not make the same frames."""
    files = (file for folder in folders for file in sorted(folder.rglob("*.py")))
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()


def _processor() -> str:
    """The model, where the system tells it: libraries pick their loops by it."""
    capability = torch.backends.cpu.get_cpu_capability()
    if not _CPUINFO.exists():
        return f"{capability} {platform.processor()}"
    models = {line for line in _CPUINFO.read_text().splitlines() if line.startswith(("model name", "CPU part"))}
    return " ".join([capability, *sorted(models)])
