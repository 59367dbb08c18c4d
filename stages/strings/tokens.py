"""The tokens of a string, the alphabet of a kit, and the error that points at a token."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from string import ascii_lowercase, ascii_uppercase
from typing import Literal

TokenKind = Literal["node", "cycle", "open", "close"]

_TOKEN = re.compile(r"%\([0-9]{1,6}\)|%[0-9][0-9]|\[[^\[\]]*\]|.", re.DOTALL)
_CONTEXT_CHARACTERS = 60
"""Characters that an error shows on each side of its position."""

LETTERS = ascii_uppercase + ascii_lowercase


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


@dataclass(frozen=True)
class Token:
    """One token of a string. Each edge belongs to tokens (strings §6)."""

    index: int
    """Where it begins in the string."""
    text: str
    kind: TokenKind
    """`node`, `cycle` for the number of a cycle edge, or `open` and `close` for the parentheses of a branch."""
    node: int
    """The node, or the one before a cycle number, in the order of the string; else -1."""
    edge: int
    """Row of the decoded edges: the edge to the parent, or the cycle edge (in two tokens); else -1."""


class StringError(ValueError):
    """A string that is no shape graph of the kit. The message shows the string with a caret at `index`."""

    def __init__(self, string: str, index: int, reason: str) -> None:
        first, last = max(0, index - _CONTEXT_CHARACTERS), min(len(string), index + _CONTEXT_CHARACTERS)
        shown = "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in string[first:last])
        before, after = "…" * (first > 0), "…" * (last < len(string))
        caret = " " * (len(before) + index - first) + "^"
        super().__init__(f"{reason}, at character {index} of {len(string)}:\n  {before}{shown}{after}\n  {caret}")
        self.string = string
        self.index = index
        self.reason = reason

    def __reduce__(self) -> tuple[type[StringError], tuple[str, int, str]]:
        return (StringError, (self.string, self.index, self.reason))


def split_tokens(string: str) -> list[str]:
    """Split a string into tokens: names in brackets, numbers with their `%`, and single characters."""
    return _TOKEN.findall(string)


def number_text(number: int) -> str:
    """Return the token of a cycle number: one digit, `%nn` from 10, `%(nnn)` from 100."""
    if number < 10:
        return str(number)
    return f"%{number}" if number < 100 else f"%({number})"


@lru_cache(maxsize=2048)
def number_value(token: str) -> int | None:
    """Return the cycle number of a token, or None if it is no number."""
    if len(token) == 1:
        return int(token) if token in "0123456789" else None
    return int(token.strip("%()")) if token[0] == "%" else None


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
