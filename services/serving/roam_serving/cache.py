"""Dictionaries that forget what was used least recently."""

from collections import OrderedDict
from typing import Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class RecentCache(Generic[K, V]):
    """Keeps at most `size` entries; reading an entry makes it the most recent."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._entries: OrderedDict[K, V] = OrderedDict()

    def __len__(self) -> int:
        return len(self._entries)

    def get(self, key: K) -> V | None:
        """The entry, or None."""
        if key not in self._entries:
            return None
        self._entries.move_to_end(key)
        return self._entries[key]

    def drop(self, key: K) -> None:
        """Forgets an entry, if it is there."""
        self._entries.pop(key, None)

    def pop_oldest(self) -> None:
        """Forgets the entry that was used least recently."""
        self._entries.popitem(last=False)

    def put(self, key: K, value: V) -> None:
        """Adds or replaces the entry and forgets the oldest beyond the size."""
        self._entries[key] = value
        self._entries.move_to_end(key)
        while len(self._entries) > self._size:
            self.pop_oldest()


class OwnedCache(Generic[K, V]):
    """At most `size` entries of all owners together; nobody sees another owner's.

    Beyond the size, whoever has most entries loses the one that was used least recently: nobody can push out what
    others keep by bringing much of their own.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._owners: dict[str, RecentCache[K, V]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._owners.values()))

    def get(self, owner: str, key: K) -> V | None:
        """An owner's entry, or None."""
        entries = self._owners.get(owner)
        return None if entries is None else entries.get(key)

    def drop(self, owner: str, key: K) -> None:
        """Forgets an owner's entry, if it is there."""
        if (entries := self._owners.get(owner)) is not None:
            entries.drop(key)
            if not len(entries):
                del self._owners[owner]

    def put(self, owner: str, key: K, value: V) -> None:
        """Adds or replaces an owner's entry; may forget one of whoever has most."""
        self._owners.setdefault(owner, RecentCache(self._size)).put(key, value)
        while len(self) > self._size:
            greedy = max(self._owners, key=lambda name: len(self._owners[name]))
            self._owners[greedy].pop_oldest()
