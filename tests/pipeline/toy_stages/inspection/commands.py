"""A room's command that reads its arguments itself."""

from __future__ import annotations

import typer

from pipeline.options import INSPECTION, forward


def _inspect(arguments: list[str]) -> int:
    print("inspect", *arguments)
    return int("--fail" in arguments)


COMMANDS = typer.Typer()
forward(COMMANDS, "inspect", INSPECTION, "Print the arguments.", _inspect)
