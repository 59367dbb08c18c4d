"""Read a table of numbers from text: any delimiter and header, decimal commas, comments, counts before the rows."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.input_file import FIRST_BYTES, decode_text

MIN_COLUMNS = 3
MAX_HEADER_LINES = 200
"""Lines before the first row of numbers; a text without numbers is given up after them."""
MAX_QUOTED_CHARACTERS = 60
MAX_COUNT_DIGITS = 18
DIALECT_LINES = 50
"""Rows by which the delimiter is told."""
MIN_DIALECT_SHARE = 0.8
"""Share of these rows that must have the delimiter."""

_NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?"
_MISSING = r"[+-]?(nan|inf|infinity|na|n/a|null|none|nil|1\.#(qnan|snan|ind|inf)\d*|nan\(\w*\)|-|)"
_IS_VALUE = re.compile(rf"({_NUMBER}|{_MISSING})", re.IGNORECASE)
_IS_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eEdD][+-]?\d+)?")
_COMMENT = re.compile(r"(#|//|%|!|\$|;(?!\s*[-+.\d]))")
_LATER_COMMENT = re.compile(r"\s(#|//|%).*$")
_MISSING_FIELD = re.compile(_MISSING, re.IGNORECASE)
_FORTRAN_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
_NUMBERS_APART = re.compile(r"[\d.]\s+[-+.\d]")
_LEADING_ZERO = re.compile(r"(?<![\d.])([-+]?0\d|-0(?![\d.]))")
_UNIT_APART = re.compile(r"\s+([\[(])")
_DELIMITERS = {";": "semicolon", "\t": "tab", "|": "bar", ",": "comma", " ": "spaces"}


class InvalidTable(ValueError):
    """A text that is no table of numbers; the message names the line, the delimiter, the header and the remedy."""


@dataclass(frozen=True)
class NumberTable:
    """A table of numbers.

    rows: float64 (n, number of `columns`); NaN where a field is empty or says that it is no number
    columns: indices of the columns in the text
    names: names of these columns by the header; empty without a header
    width: number of columns in the text
    warnings: what was taken for what
    """

    rows: FloatArray
    columns: tuple[int, ...]
    names: tuple[str, ...]
    width: int
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class _Dialect:
    """How the rows of a text are written.

    delimiter: one character; a space stands for any white space.
    decimal_comma: whether numbers have a comma in place of the point.
    """

    delimiter: str
    decimal_comma: bool

    def split(self, line: str) -> list[str]:
        fields = line.split() if self.delimiter == " " else line.split(self.delimiter)
        return [field.strip().strip("\"'").strip() for field in fields]

    @property
    def name(self) -> str:
        return _DELIMITERS[self.delimiter] + (" and decimal comma" if self.decimal_comma else "")


def read_number_table(content: bytes, choose: Callable[[Sequence[str]], tuple[int, ...]]) -> NumberTable:
    """Return the table in a text.

    choose: given the names in a line, returns the columns that are wanted; empty if the line is no header.
    Raises InvalidTable.
    """
    text = decode_text(content)
    if "\0" in text[:FIRST_BYTES]:
        raise InvalidTable("holds binary data, no text; give the file the ending of its format")
    lines = text.splitlines()
    first, before = _first_row(lines)
    sample = [bare for line in lines[first : first + DIALECT_LINES] if (bare := _bare(line))]
    dialect = _dialect(sample)
    if dialect.delimiter == "," and any(_NUMBERS_APART.search(line) for line in sample):
        lines = [line.replace(",", " ") for line in lines]
        dialect = _Dialect(" ", False)
    width = len(_without_trailing_empty(dialect.split(_bare(lines[first]))))
    header = _header([lines[index] for index in before], width, dialect, choose)
    body = _Body(lines, first, width, dialect, header)
    return body.table(before)


def _is_row(line: str) -> bool:
    """Whether a line consists of three or more numbers, whatever stands between them."""
    fields = [field.strip("\"' ") for field in re.split(r"[;\t|,]|\s+", line.strip()) if field.strip("\"' ")]
    return len(fields) >= MIN_COLUMNS and sum(_IS_VALUE.fullmatch(field) is not None for field in fields) >= MIN_COLUMNS


def _first_row(lines: Sequence[str]) -> tuple[int, list[int]]:
    """Return the index of the first row of numbers, and those of the lines before it that are not blank."""
    before: list[int] = []
    for index, line in enumerate(lines):
        if not line.strip():
            continue
        if not _is_comment(line) and _is_row(line):
            return index, before
        before.append(index)
        if len(before) > MAX_HEADER_LINES:
            break
    if not before:
        raise InvalidTable("holds blank lines only; export it again")
    raise InvalidTable(
        f"no line has three numbers; it begins with {_quoted(lines[before[0]])}. Write one point a line: x, y and z"
    )


def _is_comment(line: str) -> bool:
    return _COMMENT.match(line.lstrip()) is not None


def _bare(line: str) -> str:
    """Return a row without comments and without spaces around it; empty for a comment. Tabs may be empty fields."""
    bare = line.strip(" \r\n\f\v\x1a\ufeff")
    if _is_comment(bare) or not bare.strip():
        return ""
    return _LATER_COMMENT.sub("", bare) if "#" in bare or "//" in bare or "%" in bare else bare


def _dialect(lines: Sequence[str]) -> _Dialect:
    """Return how most rows are written. Semicolons, tabs and bars go before commas, which may belong to the numbers."""
    for delimiter in ";\t|":
        if _most(line.count(delimiter) >= MIN_COLUMNS - 1 for line in lines):
            fields = [field for line in lines for field in _Dialect(delimiter, False).split(line)]
            return _Dialect(delimiter, any(_IS_DECIMAL_COMMA.fullmatch(field) for field in fields))
    if any(_IS_DECIMAL_COMMA.fullmatch(word) for line in lines for word in line.split()) and _most(
        len(line.split()) >= MIN_COLUMNS
        and all(_IS_DECIMAL_COMMA.fullmatch(word) or _IS_VALUE.fullmatch(word) for word in line.split())
        for line in lines
    ):
        return _Dialect(" ", True)
    return _Dialect("," if _most(line.count(",") >= MIN_COLUMNS - 1 for line in lines) else " ", False)


def _most(holds: Iterable[bool]) -> bool:
    flags = list(holds)
    return sum(flags) >= MIN_DIALECT_SHARE * len(flags)


@dataclass(frozen=True)
class _Header:
    """The line that names the columns.

    line: its text; empty without a header.
    names: of all columns of the text.
    columns: the wanted ones; empty for all.
    """

    line: str = ""
    names: tuple[str, ...] = ()
    columns: tuple[int, ...] = ()


def _header(
    lines: Sequence[str], width: int, dialect: _Dialect, choose: Callable[[Sequence[str]], tuple[int, ...]]
) -> _Header:
    """Return the last of the lines before the rows that names the columns. Raises InvalidTable for unknown names."""
    for line in reversed(lines):
        for names in _name_lists(line, dialect):
            columns = choose(names)
            if not columns:
                continue
            if len(names) == width:
                return _Header(line, tuple(names), columns)
            if len(names) == width - 1:  # row numbers without a name, as R writes them
                return _Header(line, ("", *names), tuple(column + 1 for column in columns))
            if not _is_comment(line) or 2 * len(names) == width:
                raise InvalidTable(
                    f"the header {_quoted(line)} has {len(names)} names and the rows have {width} fields (delimiter "
                    f"{dialect.name}); name each column, and put semicolons between numbers with decimal commas"
                )
    for line in lines:
        if not _is_comment(line) and len(_without_trailing_empty(dialect.split(line))) == width:
            raise InvalidTable(
                f"the header {_quoted(line)} (delimiter {dialect.name}) names no x, y and z; name the columns of the "
                "coordinates x, y and z"
            )
    return _Header()


def _name_lists(line: str, dialect: _Dialect) -> Iterator[list[str]]:
    """Yield the names in a line by each delimiter, that of the rows first; of a comment also those after a colon."""
    texts = [line]
    if _is_comment(line):
        bare = line.strip().lstrip("#/%!$;* ")
        texts = [bare, bare.partition(":")[2]]
    for text in texts:
        for delimiter in dict.fromkeys((dialect.delimiter, *_DELIMITERS)):
            joined = _UNIT_APART.sub(r"\1", text) if delimiter == " " else text
            yield _without_trailing_empty(_Dialect(delimiter, False).split(joined))


class _Body:
    """The rows of a text.

    Lines that are no rows are blanked, so that the index of a line stays its number.
    """

    def __init__(self, lines: list[str], first: int, width: int, dialect: _Dialect, header: _Header) -> None:
        self.original = lines
        self.dialect = dialect
        self.header = header
        self.width = width
        self.first = first
        self.warnings: list[str] = []
        self.lines = [""] * first + [_bare(line) for line in lines[first:]]

    def table(self, before: Sequence[int]) -> NumberTable:
        """Return the table. before: indices of the lines before the rows that are not blank."""
        self._take_counts(before)
        self._drop_numbered_header()
        self._check_decimal_commas()
        columns = self.header.columns or tuple(range(self.width))
        rows = self._parsed(columns)
        names = tuple(self.header.names[column] for column in columns) if self.header.names else ()
        left_out = [name for column, name in enumerate(self.header.names) if name and column not in columns]
        if left_out:
            self.warnings.append(f"columns {_quoted(', '.join(left_out))} were left out")
        return NumberTable(rows, columns, names, self.width, tuple(self.warnings))

    def _take_counts(self, before: Sequence[int]) -> None:
        """Compare the rows with the counts before them, as PTS files have them, one for each of their scans."""
        counts: list[tuple[int, int]] = []
        for index in before:
            words = self.original[index].split()
            if len(words) in (1, 2) and all(map(str.isdecimal, words)) and words[1:] in ([], [str(self.width)]):
                counts = [(index, int(words[0][:MAX_COUNT_DIGITS]))]
            elif not _is_comment(self.original[index]) and self.original[index] != self.header.line:
                self.warnings.append(f"line {index + 1}, {_quoted(self.original[index])}, is no row and was left out")
        if not counts:
            return
        later = [index for index, line in enumerate(self.lines) if line.isdecimal()]
        counts += [(index, int(self.lines[index][:MAX_COUNT_DIGITS])) for index in later]
        ends = [*later, len(self.lines)]
        for (start, count), end in zip(counts, ends, strict=True):
            found = sum(map(bool, self.lines[start + 1 : end]))
            if found != count:
                raise InvalidTable(
                    f"line {start + 1} announces {count:,} points and {found:,} follow; copy or export the file again"
                )
        for index in later:
            self.lines[index] = ""

    def _drop_numbered_header(self) -> None:
        """Blank a first row 0, 1, 2, ... above fractions: the names that pandas gives to columns without names."""
        fields = self.dialect.split(self.lines[self.first])
        numbers = fields[1:] if not fields[0] else fields
        following = next((line for line in self.lines[self.first + 1 :] if line), "")
        is_numbered = numbers == [str(index) for index in range(len(numbers))]
        if self.header.names or not is_numbered or "." not in following:
            return
        self.lines[self.first] = ""
        self.warnings.append(f"line {self.first + 1}, {_quoted(self.original[self.first])}, numbers the columns")
        if len(numbers) < len(fields):
            self.header = _Header(columns=tuple(range(1, self.width)))

    def _check_decimal_commas(self) -> None:
        """Refuse rows such as 0,5,0,05,-0,7: a table of whole numbers has no leading zeros and no -0."""
        if self.dialect.delimiter != "," or self.header.names:
            return
        sample = [line for line in self.lines[self.first : self.first + MAX_HEADER_LINES] if line]
        if not any("." in line for line in sample) and any(map(_LEADING_ZERO.search, sample)):
            raise InvalidTable(
                f"line {self.first + 1}, {_quoted(self.original[self.first])}, has commas between its numbers and in "
                "them; write decimal points, or put semicolons between the numbers"
            )

    def _parsed(self, columns: tuple[int, ...]) -> FloatArray:
        """Return the values of some columns, float64 (n, columns)."""
        delimiter = self.dialect.delimiter
        rows = [line for line in self.lines if line]
        if self._is_uneven(rows):
            raise InvalidTable(self._fault(columns))
        if self.dialect.decimal_comma:
            rows = [line.replace(",", ".") for line in rows]
        try:
            return self._loaded(rows, delimiter, columns)
        except ValueError:
            rows = [self._plain(line, columns) for line in rows]
        try:
            return self._loaded(rows, " ", tuple(range(len(columns))))
        except ValueError:
            raise InvalidTable(self._fault(columns)) from None

    def _loaded(self, rows: list[str], delimiter: str, columns: tuple[int, ...]) -> FloatArray:
        return np.loadtxt(
            rows,
            delimiter=None if delimiter == " " else delimiter,
            comments=None,
            usecols=columns,
            ndmin=2,
            dtype=np.float64,
        )

    def _plain(self, line: str, columns: tuple[int, ...]) -> str:
        """Return the wanted fields of a row with spaces between them, `nan` for what is missing."""
        dialect = _Dialect(self.dialect.delimiter, False)  # decimal commas are points by now
        fields = dialect.split(line)
        chosen = [fields[column] if column < len(fields) else "" for column in columns]
        return " ".join(
            "nan" if _MISSING_FIELD.fullmatch(field) else _FORTRAN_EXPONENT.sub("e", field.replace(" ", "?"))
            for field in chosen
        )

    def _is_uneven(self, rows: list[str]) -> bool:
        """Whether rows have several numbers of fields; empty ones at the end do not count."""
        delimiter = self.dialect.delimiter
        counts = {len(line.split()) for line in rows} if delimiter == " " else {line.count(delimiter) for line in rows}
        if len(counts) == 1:
            return False
        return any(len(_without_trailing_empty(self.dialect.split(line))) > self.width for line in rows) or any(
            len(self.dialect.split(line)) < self.width for line in rows
        )

    def _fault(self, columns: tuple[int, ...]) -> str:
        """Say which line is no row, and how the rows were read."""
        header = f"header {_quoted(self.header.line)}" if self.header.line else "no header"
        how = f"delimiter {self.dialect.name}, {header}"
        remedy = "mend the line or export the table again"
        for index, line in enumerate(self.lines):
            if not line:
                continue
            fields = self.dialect.split(line)
            count = len(_without_trailing_empty(fields))
            if count > self.width or len(fields) < self.width:
                return (
                    f"line {index + 1} has {count} fields and line {self.first + 1} has {self.width} ({how}): "
                    f"{_quoted(line)}; {remedy}"
                )
            for column in columns:
                field = fields[column].replace(",", ".") if self.dialect.decimal_comma else fields[column]
                if _IS_VALUE.fullmatch(field) is None:
                    naming = "" if self.header.line else "name the columns x, y and z in a header line, or "
                    return f"line {index + 1}: {_quoted(fields[column])} is no number ({how}); {naming}{remedy}"
        return f"no table of numbers ({how}); export it again"


def _without_trailing_empty(fields: list[str]) -> list[str]:
    """Return the fields up to the last that is not empty."""
    end = len(fields)
    while end and not fields[end - 1]:
        end -= 1
    return fields[:end]


def _quoted(text: str) -> str:
    """Return a line of a file for a message, printable and short."""
    shown = "".join(character if character.isprintable() else " " for character in text.strip())
    return repr(shown if len(shown) <= MAX_QUOTED_CHARACTERS else shown[:MAX_QUOTED_CHARACTERS] + "…")
