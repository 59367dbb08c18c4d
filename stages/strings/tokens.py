"""The tokens of a string, and the error that points at one of them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

TokenKind = Literal["node", "cycle", "open", "close"]

_TOKEN = re.compile(r"%\([0-9]{1,6}\)|%[0-9][0-9]|\[[^\[\]]*\]|.", re.DOTALL)
_SHOWN = 60
"""An error shows so many characters on each side of its place."""


@dataclass(frozen=True)
class Token:
    """One token of a string.

    index: where it begins in the string; kind: `node` for a node, `cycle` for the number of a cycle edge, `open` and
    `close` for the parentheses of a branch.
    node: for `node` the node itself, for `cycle` the node that the number stands behind, else -1; nodes are counted in
    the order in which they stand in the string.
    edge: row of the decoded edges: for `node` the edge to its parent in the spanning tree (-1 for the root), for
    `cycle` the cycle edge (two tokens name the same), else -1. So each edge belongs to characters (strings §6).
    """

    index: int
    text: str
    kind: TokenKind
    node: int
    edge: int


class StringError(ValueError):
    """A string that is no shape graph, or none of the kit. Its message shows the string with a caret at `index`."""

    def __init__(self, string: str, index: int, reason: str) -> None:
        first, last = max(0, index - _SHOWN), min(len(string), index + _SHOWN)
        shown = "".join(each if each.isprintable() else "\N{REPLACEMENT CHARACTER}" for each in string[first:last])
        before, after = "…" * (first > 0), "…" * (last < len(string))
        caret = " " * (len(before) + index - first) + "^"
        super().__init__(f"{reason}, at character {index} of {len(string)}:\n  {before}{shown}{after}\n  {caret}")
        self.string = string
        self.index = index
        self.reason = reason

    def __reduce__(self) -> tuple[type[StringError], tuple[str, int, str]]:
        return (StringError, (self.string, self.index, self.reason))


def split_tokens(string: str) -> list[str]:
    """The texts of the tokens: node names in brackets, numbers with their `%`, every other character alone."""
    return _TOKEN.findall(string)


def number_text(number: int) -> str:
    """The suffix for the cycle number `number`: one digit, `%nn` from 10, `%(nnn)` from 100."""
    if number < 10:
        return str(number)
    return f"%{number}" if number < 100 else f"%({number})"


@lru_cache(maxsize=2048)
def number_value(token: str) -> int | None:
    """The cycle number that a token stands for, or None if it is no number."""
    if len(token) == 1:
        return int(token) if token in "0123456789" else None
    return int(token.strip("%()")) if token[0] == "%" else None
