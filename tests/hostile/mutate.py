"""Hostile files from good ones: flipped bytes, cuts, repeated and swapped tokens, extreme numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

MAX_BYTES = 1_000_000
"""Bytes of a hostile file: what makes one expensive is to be in it, and not its length."""
TOKEN = re.compile(rb'[^\s<>{}\[\],:"]+')
NUMBER = re.compile(rb"(?<![\w#.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?!\w)")
EXTREMES = [
    b"0", b"-1", b"-0", b"1e308", b"-1e308", b"1e400", b"1e-320", b"nan", b"inf", b"2147483647", b"2147483648",
    b"4294967296", b"9223372036854775808", b"1" + b"0" * 400, b"9" * 5000, b"0x10", b"1.5", b"", b"1 2", b"null", b"[]",
    b"{}", b'"text"', b"true", b"1000000000000", b"65536", b"255",
]  # fmt: skip
WORDS = [b"../../etc/passwd", b"/etc/passwd", b"file:///etc/passwd", b"data:,x", b"\\ud800", b"\x1b[31m", b"a" * 5000,
         b"%00", b"\xff\xfe", b"#", b"..", b"~", b"skin.png", b"%s%n"]  # fmt: skip


def mutate(content: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """The name of a mutation and what it makes of `content`; up to three of the same kind."""
    name = list(MUTATIONS)[rng.integers(len(MUTATIONS))]
    for _ in range(rng.integers(1, 4)):
        content = MUTATIONS[name](content, rng)[:MAX_BYTES]
    return name, content


def _flip_bytes(content: bytes, rng: np.random.Generator) -> bytes:
    flipped = bytearray(content)
    for place in rng.integers(len(content), size=rng.integers(1, 9)) if content else ():
        flipped[place] ^= 1 << int(rng.integers(8))
    return bytes(flipped)


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(len(content) + 1)]


def _take_out(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = sorted(rng.integers(len(content) + 1, size=2).tolist())
    return content[:begin] + content[max(begin, end - int(rng.integers(len(content) + 1))) :]


def _repeat_token(content: bytes, rng: np.random.Generator) -> bytes:
    times = int(rng.choice([2, 10, 2000]))
    return _at_token(content, rng, lambda token: (token + b" ") * min(times, 1 + MAX_BYTES // len(token)))


def _repeat_line(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True) or [b""]
    place = int(rng.integers(len(lines)))
    times = min(int(rng.choice([2, 50, 2000])), 1 + MAX_BYTES // len(lines[place] or b" "))
    return b"".join([*lines[:place], lines[place] * times, *lines[place + 1 :]])


def _swap_tokens(content: bytes, rng: np.random.Generator) -> bytes:
    tokens = TOKEN.findall(content) or [b""]
    return _at_token(content, rng, lambda _: tokens[int(rng.integers(len(tokens)))])


def _extreme_number(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(NUMBER.finditer(content))
    if not found:
        return content
    chosen = found[int(rng.integers(len(found)))]
    return content[: chosen.start()] + EXTREMES[int(rng.integers(len(EXTREMES)))] + content[chosen.end() :]


def _hostile_word(content: bytes, rng: np.random.Generator) -> bytes:
    return _at_token(content, rng, lambda _: WORDS[int(rng.integers(len(WORDS)))])


def _extreme_binary(content: bytes, rng: np.random.Generator) -> bytes:
    extreme = [b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\x80\x7f", b"\0\0\xc0\x7f", b"\0\0\0\x80"]
    place = int(rng.integers(max(1, len(content) - 4))) // 4 * 4
    return content[:place] + extreme[int(rng.integers(len(extreme)))] + content[place + 4 :]


def _at_token(content: bytes, rng: np.random.Generator, change: Callable[[bytes], bytes]) -> bytes:
    found = list(TOKEN.finditer(content))
    if not found:
        return content
    chosen = found[int(rng.integers(len(found)))]
    return content[: chosen.start()] + change(chosen[0]) + content[chosen.end() :]


MUTATIONS: Mapping[str, Callable[[bytes, np.random.Generator], bytes]] = {
    "flipped bytes": _flip_bytes,
    "cut off": _cut,
    "a piece taken out": _take_out,
    "a repeated token": _repeat_token,
    "a repeated line": _repeat_line,
    "swapped tokens": _swap_tokens,
    "an extreme number": _extreme_number,
    "a hostile word": _hostile_word,
    "an extreme binary number": _extreme_binary,
}
