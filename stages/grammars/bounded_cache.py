"""Values that are costly to make and large to hold: those asked for last."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class BoundedCache(Generic[Key, Value]):
    """Values by their keys, each made when it is asked for. As soon as all take more than so many bytes, those are
    forgotten that were not asked for the longest, and made anew if they are needed again."""

    def __init__(self, make: Callable[[Key], Value], size: Callable[[Value], int], most: int) -> None:
        """make: a value of its key, always the same; size: the bytes of a value; most: the bytes of all."""
        self._make, self._size_of, self._most = make, size, most
        self._held: OrderedDict[Key, Value] = OrderedDict()
        self._size = 0

    def __len__(self) -> int:
        return len(self._held)

    def __getitem__(self, key: Key) -> Value:
        if key in self._held:
            self._held.move_to_end(key)
            return self._held[key]
        value = self._make(key)
        self._held[key] = value
        self._size += self._size_of(value)
        while self._size > self._most and len(self._held) > 1:
            self._size -= self._size_of(self._held.popitem(last=False)[1])
        return value
