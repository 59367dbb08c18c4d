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
    """The tokens of a kit's types, by type index."""

    tokens: tuple[str, ...]
    names: tuple[str, ...]
    """Of the types."""

    @cached_property
    def types(self) -> dict[str, int]:
        """The type index of each token."""
        return {token: index for index, token in enumerate(self.tokens)}

    def vocabulary(self) -> dict[str, str]:
        """Return the type name of each token."""
        return dict(zip(self.tokens, self.names, strict=True))


def make_alphabet(names: Sequence[str]) -> Alphabet:
    """Make the alphabet of a kit whose types have `names`, in order.

    The tokens are A to Z, then a to z. With more types, every token is its name in brackets, `[tower_wall]`, with `_`
    for characters other than letters, digits, `_`, `-` and `.`, and a number after names that would be equal.
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
