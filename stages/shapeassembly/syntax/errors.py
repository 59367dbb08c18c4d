"""Errors of programs, with the place in the text."""

from __future__ import annotations


class ProgramError(ValueError):
    """A program that cannot be read or executed.

    reason: a short phrase that is the same for every program, and is counted.
    detail: what was wrong here, and the remedy.
    line, column: place in the text, from 1, where there is a text.
    source: the line of the text, shown with a caret.
    """

    def __init__(self, reason: str, detail: str = "", line: int = 0, column: int = 0, source: str = "") -> None:
        message = f"{reason}: {detail}" if detail else reason
        if line:
            shown = source.expandtabs(1)
            message = f"line {line}, column {column}: {message}\n{shown}\n{' ' * (column - 1)}^"
        super().__init__(message)
        self.reason = reason
        self.detail = detail
        self.line = line
        self.column = column
