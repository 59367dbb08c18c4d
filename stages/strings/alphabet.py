"""The alphabet of a kit: one token for each part type."""

from __future__ import annotations

import re
import string
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

LETTERS = string.ascii_uppercase + string.ascii_lowercase


@dataclass(frozen=True)
class Alphabet:
    """tokens: the text that stands for each type in strings, by type index; names: the types' names."""

    tokens: tuple[str, ...]
    names: tuple[str, ...]

    @cached_property
    def types(self) -> dict[str, int]:
        """Type index of each token."""
        return {token: index for index, token in enumerate(self.tokens)}

    def vocabulary(self) -> dict[str, str]:
        """Name of the type that each token stands for."""
        return dict(zip(self.tokens, self.names, strict=True))


def make_alphabet(names: Sequence[str]) -> Alphabet:
    """The alphabet of a kit whose types have `names`, in order.

    The first 26 types are the letters A to Z, the next a to z. A kit with more than these writes every type as its
    name in brackets, `[tower_wall]`, with `_` for each character but letters, digits, `_`, `-` and `.`, and with a
    number behind names that would be equal.
    """
    if len(names) <= len(LETTERS):
        return Alphabet(tuple(LETTERS[: len(names)]), tuple(names))
    tokens: dict[str, None] = {}
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
        token, number = f"[{plain}]", 2
        while token in tokens:
            token, number = f"[{plain}_{number}]", number + 1
        tokens[token] = None
    return Alphabet(tuple(tokens), tuple(names))
