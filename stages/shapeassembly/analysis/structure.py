"""The structure of a program without its continuous parameters: tokens, signatures, distances (shapeassembly §7.1).

Names are ignored: cuboids are counted within their assembly, and an assembly is inserted where its cuboid is declared.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from stages.shapeassembly.execution.tables import next_copy_name
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.limits import MAX_DEPTH, MAX_TEXT_CHARACTERS
from stages.shapeassembly.syntax.program import BBOX, AssemblyProgram, Attach, Block, Cuboid, Reflect, Squeeze


def tokens(program: AssemblyProgram) -> list[str]:
    """Return the program as words: commands, cuboid numbers, flags, faces, axes, counts.

    Programs with equal tokens are the same up to continuous parameters (shapeassembly §7.1.4).
    Raises ProgramError where assemblies contain themselves, or there are too many words.
    """
    words: list[str] = []
    _add(program.root, program, words, 1)
    return words


def _add(block: Block, program: AssemblyProgram | None, words: list[str], depth: int) -> None:
    """Append the words of one assembly, with those of its cuboids if `program` is given."""
    if depth > MAX_DEPTH:
        raise ProgramError("too deep", f"assemblies are nested more than {MAX_DEPTH} deep, or in a circle")
    if len(words) > MAX_TEXT_CHARACTERS:
        raise ProgramError("too long", f"expanded it has more than {MAX_TEXT_CHARACTERS} words")
    slots = {BBOX: 0}
    words.append("{")
    for line in block.lines:
        if isinstance(line, Cuboid):
            slots[line.name] = len(slots)
            words += ["Cuboid", str(line.aligned)]
            below = program.named.get(line.name) if program else None
            if below is not None:
                _add(below, program, words, depth + 1)
        elif isinstance(line, Attach):
            words += ["attach", _number(slots, line.moved), _number(slots, line.target)]
        elif isinstance(line, Squeeze):
            words += ["squeeze", *(_number(slots, name) for name in (line.moved, line.first, line.second)), line.face]
        else:
            copies = 1 if isinstance(line, Reflect) else line.copies
            for _ in range(copies):
                slots[next_copy_name(slots)] = len(slots)
            kind = ["reflect"] if isinstance(line, Reflect) else ["translate", str(copies)]
            words += [*kind, _number(slots, line.moved), line.axis]
    words.append("}")


def _number(slots: dict[str, int], name: str) -> str:
    return str(slots.get(name, name))


def signature(program: AssemblyProgram) -> str:
    """Return the hex sha256 of the tokens: equal for programs that are the same up to continuous parameters."""
    return _digest(tokens(program))


def block_signatures(program: AssemblyProgram) -> tuple[str, ...]:
    """Return the hex sha256 of the tokens of each assembly by itself, with the set of its expanded cuboids."""
    digests = []
    for block in program.blocks:
        words: list[str] = []
        _add(block, None, words, 1)
        expanded = [str(index) for index, cuboid in enumerate(block.cuboids) if cuboid.name in program.named]
        digests.append(_digest([*words, "|", *expanded]))
    return tuple(digests)


def program_distance(a: AssemblyProgram, b: AssemblyProgram) -> int:
    """Return the edit distance of the tokens of two programs."""
    return token_distance(tokens(a), tokens(b))


def token_distance(first: Sequence[str], second: Sequence[str]) -> int:
    """Return the edit distance of tokens."""
    from stages.shapeassembly.analysis.edit_distance import edit_distance

    codes = {word: index for index, word in enumerate(dict.fromkeys([*first, *second]))}
    distance: int = edit_distance(np.array([codes[w] for w in first]), np.array([codes[w] for w in second]))
    return distance


def _digest(words: Sequence[str]) -> str:
    return hashlib.sha256(" ".join(words).encode()).hexdigest()
