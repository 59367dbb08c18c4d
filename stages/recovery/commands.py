"""Commands of this room; see `pipeline/options.py`."""

from __future__ import annotations

import typer

from pipeline.options import MODELS, forward


def _recover(arguments: list[str]) -> int:
    from stages.recovery.__main__ import main

    return main(arguments)


COMMANDS = typer.Typer()
forward(COMMANDS, "recover", MODELS, "Find the program and parameters of a scan, mesh or drawing.", _recover)
