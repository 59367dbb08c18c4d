"""Commands of this room; see `pipeline/options.py`."""

from __future__ import annotations

import typer

from pipeline.options import INSPECTION, forward


def _programs(arguments: list[str]) -> int:
    from stages.programs.__main__ import main

    return main(arguments)


COMMANDS = typer.Typer()
forward(COMMANDS, "programs", INSPECTION, "Inspect, draw, mix and interpolate shape programs.", _programs)
