"""Commands of this room; see `pipeline/options.py`."""

from __future__ import annotations

import typer

from pipeline.options import INSPECTION, forward


def _inspect(arguments: list[str]) -> int:
    from stages.inspection.inspect import main

    return main(arguments)


COMMANDS = typer.Typer()
forward(COMMANDS, "inspect", INSPECTION, "Show what can be made of a mesh, and write a config for it.", _inspect)
