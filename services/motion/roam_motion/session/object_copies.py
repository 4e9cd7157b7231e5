"""Objects that two processes hold in common: an object crosses once, afterwards its number does.

One side owns the objects and numbers them as long as they live (`Originals`); the other keeps a copy of each until it
is told that the original is gone (`Copies`).
"""

import weakref
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Changes(Generic[T]):
    """What the other side does not have yet, by number, and what it may forget."""

    new: dict[int, T]
    gone: list[int]


class Originals(Generic[T]):
    """Numbers of things that live on this side; things are told apart by identity."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[weakref.ref[T], int]] = {}  # by id
        self._new: dict[int, T] = {}
        self._gone: deque[int] = deque()  # things may die in any thread
        self._free = count(1)

    def number(self, thing: T) -> int:
        """The number of a thing; a new one goes into the next changes."""
        known = self._known.get(id(thing))
        if known is not None:
            return known[1]
        number = next(self._free)
        self._new[number] = thing
        self._watch(thing, number)
        return number

    def reserve(self, numbers: int) -> range:
        """Numbers for things that the other side is about to make."""
        first = next(self._free)
        self._free = count(first + numbers)
        return range(first, first + numbers)

    def adopt(self, things: Sequence[T], numbers: Sequence[int]) -> None:
        """Copies of what the other side has made are from now on the originals; reserved numbers left over are free."""
        for thing, number in zip(things, numbers, strict=False):
            self._watch(thing, number)

    def changes(self) -> Changes[T]:
        """What has come and gone since the last time."""
        new, self._new = self._new, {}
        return Changes(new, [self._gone.popleft() for _ in range(len(self._gone))])

    def _watch(self, thing: T, number: int) -> None:
        key = id(thing)

        def forget(_: object) -> None:
            del self._known[key]
            self._gone.append(number)

        self._known[key] = weakref.ref(thing, forget), number


class Copies(Generic[T]):
    """Copies of what the other side owns."""

    def __init__(self) -> None:
        self._things: dict[int, T] = {}

    def __getitem__(self, number: int) -> T:
        return self._things[number]

    def take(self, changes: Changes[T]) -> None:
        """Learns and forgets."""
        self._things.update(changes.new)
        for number in changes.gone:
            self._things.pop(number, None)

    def keep(self, things: Sequence[T], numbers: Sequence[int]) -> None:
        """What was made here for the other side."""
        self._things.update(zip(numbers, things, strict=False))
