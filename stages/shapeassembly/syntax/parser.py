"""Parse the text of a ShapeAssembly program (shapeassembly table 1).

Blanks, tabs and line ends may separate words. A syntax error states its place and what would be right. A cuboid without
its flag is not aligned, as in the authors' parser. `checks` examines whether the lines make sense together.
"""

from __future__ import annotations

import re
from typing import NoReturn, cast

from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.limits import MAX_COPIES, MAX_LINES, MAX_NUMBER, MAX_TEXT_CHARACTERS
from stages.shapeassembly.syntax.program import (
    AXES,
    BBOX,
    FACES,
    AssemblyProgram,
    Attach,
    Axis,
    Block,
    Cuboid,
    Face,
    Line,
    Point,
    Reflect,
    Squeeze,
    Translate,
)

_TOKEN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*|[-+.0-9](?:[A-Za-z0-9_.]|(?<=[eE])[-+])*|[=(),{}]|[^ \t\r\n]")
_COMMANDS = ("attach", "squeeze", "reflect", "translate")
_RESERVED = frozenset({"Assembly", "Cuboid", "True", "False", *_COMMANDS})
_NAME_START = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_")
_NUMBER_START, _NUMBER_END = frozenset("+-.0123456789"), frozenset(".0123456789")


def parse(text: str) -> AssemblyProgram:
    """Parse a text. Raises ProgramError with line, column and reason at the first syntax error."""
    if len(text) > MAX_TEXT_CHARACTERS:
        raise ProgramError("too long", f"{len(text)} characters; a program has at most {MAX_TEXT_CHARACTERS}")
    return _Reader(text).program()


class _Reader:
    """Reads one text word by word."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.words: list[str] = _TOKEN.findall(text)
        self.words.append("")
        self.index = 0

    def program(self) -> AssemblyProgram:
        blocks: list[Block] = []
        names: set[str] = set()
        if self.words[0] == "":
            self.refuse("empty", "a program starts with 'Assembly NAME {'")
        while self.words[self.index] != "":
            self.expect("Assembly")
            name = self.name("a name for the assembly")
            if name in names or name == BBOX:
                self.index -= 1
                self.refuse("name taken", f"an assembly named {name!r} cannot be told from another; rename it")
            names.add(name)
            blocks.append(self.block(name))
        return AssemblyProgram(tuple(blocks))

    def block(self, name: str) -> Block:
        self.expect("{")
        if self.words[self.index] != BBOX:
            self.refuse("no bounding box", f"an assembly starts with '{BBOX} = Cuboid(l, h, w, True)'")
        bbox = self.cuboid()
        lines: list[Line] = []
        while self.words[self.index] != "}":
            if len(lines) == MAX_LINES:
                self.refuse("too many lines", f"an assembly has at most {MAX_LINES}")
            lines.append(self.line())
        self.index += 1
        return Block(name, bbox, tuple(lines))

    def line(self) -> Line:
        word = self.words[self.index]
        if word == "attach":
            moved, target = self.opened(), self.argument()
            source = self.point()
            attach = Attach(moved, target, source, self.point())
            self.expect(")")
            return attach
        if word == "squeeze":
            moved, first, second = self.opened(), self.argument(), self.argument()
            face = cast(Face, self.one_of(FACES, "a face"))
            u = self.comma_number()
            squeeze = Squeeze(moved, first, second, face, u, self.comma_number())
            self.expect(")")
            return squeeze
        if word == "reflect":
            reflect = Reflect(self.opened(), cast(Axis, self.one_of(AXES, "an axis")))
            self.expect(")")
            return reflect
        if word == "translate":
            moved, axis = self.opened(), cast(Axis, self.one_of(AXES, "an axis"))
            copies = self.count()
            translate = Translate(moved, axis, copies, self.comma_number())
            self.expect(")")
            return translate
        if word == "":
            self.refuse("text ends", "the assembly is not closed; '}' is missing")
        if self.words[self.index + 1] == "(":
            self.refuse("unknown command", f"{word!r} is not one of {', '.join(_COMMANDS)}")
        return self.cuboid()

    def cuboid(self) -> Cuboid:
        name = self.name("a line: 'NAME = Cuboid(...)' or a command")
        self.expect("=")
        self.expect("Cuboid")
        self.expect("(")
        length = self.number()
        height = self.comma_number()
        dims = (length, height, self.comma_number())
        flagged = self.words[self.index] != ")"
        aligned = flagged and self.one_of(("True", "False"), "the aligned flag") == "True"
        self.expect(")")
        return Cuboid(name, dims, aligned)

    def opened(self) -> str:
        """Read the first argument of a command."""
        self.index += 1
        self.expect("(")
        return self.name("the name of a cuboid")

    def argument(self) -> str:
        self.expect(",")
        return self.name("the name of a cuboid")

    def point(self) -> Point:
        x = self.comma_number()
        y = self.comma_number()
        return (x, y, self.comma_number())

    def name(self, wanted: str) -> str:
        word = self.words[self.index]
        if word[:1] not in _NAME_START or word in _RESERVED:
            self.unexpected(wanted)
        self.index += 1
        return word

    def one_of(self, words: tuple[str, ...], wanted: str) -> str:
        self.expect(",")
        word = self.words[self.index]
        if word not in words:
            self.unexpected(f"{wanted}, one of {', '.join(words)}")
        self.index += 1
        return word

    def comma_number(self) -> float:
        if self.words[self.index] != ",":
            self.unexpected("','")
        self.index += 1
        return self.number()

    def number(self) -> float:
        word = self.words[self.index]
        if word[:1] not in _NUMBER_START or word[-1] not in _NUMBER_END or "_" in word:
            self.unexpected("a number")
        try:
            value = float(word)
        except ValueError:
            self.unexpected("a number")
        if not -MAX_NUMBER <= value <= MAX_NUMBER:
            self.refuse("number too large", f"{word} is beyond {MAX_NUMBER:g}")
        self.index += 1
        return value

    def count(self) -> int:
        self.expect(",")
        word = self.words[self.index]
        if not word.isdecimal():
            self.unexpected("a whole number of copies")
        if len(word) > 9 or not 1 <= int(word) <= MAX_COPIES:
            self.refuse("number of copies", f"{word[:20]} is not from 1 to {MAX_COPIES}")
        self.index += 1
        return int(word)

    def expect(self, word: str) -> None:
        if self.words[self.index] != word:
            self.unexpected(repr(word))
        self.index += 1

    def unexpected(self, wanted: str) -> NoReturn:
        word = self.words[self.index]
        if word == "":
            self.refuse("text ends", f"{wanted} is missing")
        self.refuse("syntax", f"{word!r} found where {wanted} is expected")

    def refuse(self, reason: str, detail: str) -> NoReturn:
        """Raise an error at the current word."""
        offset = len(self.text.rstrip())
        for number, match in enumerate(_TOKEN.finditer(self.text)):
            if number == self.index:
                offset = match.start()
                break
        start = self.text.rfind("\n", 0, offset) + 1
        end = self.text.find("\n", offset)
        source = self.text[start : end if end >= 0 else len(self.text)]
        raise ProgramError(reason, detail, self.text.count("\n", 0, offset) + 1, offset - start + 1, source[:200])
