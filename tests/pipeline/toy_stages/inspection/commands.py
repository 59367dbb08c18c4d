"""A room's group of commands."""

from __future__ import annotations

import typer

from pipeline.options import INSPECTION

COMMANDS = typer.Typer(name="inspect", help="Inspect models.", rich_help_panel=INSPECTION)


@COMMANDS.command()
def mesh(model: str, json: bool = False, fail: bool = False) -> None:
    """Print the arguments; exit with 1 if asked."""
    print("inspect", model, json)
    raise typer.Exit(int(fail))


@COMMANDS.command()
def program(name: str) -> None:
    """Print the arguments."""
    print("program", name)
