"""Commands of this room; see `pipeline/options.py`."""

from __future__ import annotations

import typer

from pipeline.options import EVALUATION, forward


def _eval(arguments: list[str]) -> int:
    from eval.__main__ import main

    return main(arguments)


COMMANDS = typer.Typer()
forward(COMMANDS, "eval", EVALUATION, "Print a table about a dataset; without one, list the tables.", _eval)
