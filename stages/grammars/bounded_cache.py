"""A cache of values that are costly to make and large, bounded in bytes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class BoundedCache(Generic[Key, Value]):
    """Values by their keys, made on first use; the least recently used are dropped as soon as all exceed the limit."""

    def __init__(self, make: Callable[[Key], Value], size_of: Callable[[Value], int], max_bytes: int) -> None:
        """Bound the values of `make`, a pure function of the key, by their sizes in bytes."""
        self._make, self._size_of, self._max_bytes = make, size_of, max_bytes
        self._values: OrderedDict[Key, Value] = OrderedDict()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._values)

    def __getitem__(self, key: Key) -> Value:
        if key in self._values:
            self._values.move_to_end(key)
            return self._values[key]
        value = self._make(key)
        self._values[key] = value
        self._bytes += self._size_of(value)
        while self._bytes > self._max_bytes and len(self._values) > 1:
            self._bytes -= self._size_of(self._values.popitem(last=False)[1])
        return value
