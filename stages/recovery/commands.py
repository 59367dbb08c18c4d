"""`shapemill recover`."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from pipeline.errors import ConfigError
from pipeline.options import DEFAULT_OUT, MODELS

COMMANDS = typer.Typer()


class UpAxis(StrEnum):
    """Choices of `--up`."""

    BEST = ""
    X = "x"
    Y = "y"
    Z = "z"


@COMMANDS.command(rich_help_panel=MODELS)
def recover(
    source: Annotated[Path, typer.Argument(metavar="INPUT", help="cloud, mesh, drawing, folder of them, or shard")],
    program: Annotated[str, typer.Option(help="name of the program; the likeliest by default")] = "",
    up: Annotated[UpAxis, typer.Option(help="the axis of clouds that points up; the best by default")] = UpAxis.BEST,
    out: Annotated[Path, typer.Option(help="where models are, and results go")] = DEFAULT_OUT,
    budget: Annotated[int, typer.Option(min=1, help="most shapes built for an input")] = 600,
    seed: Annotated[int, typer.Option(min=0, help="seed of the search")] = 0,
) -> None:
    """Find the program and parameters of a scan, mesh or drawing; exit with 1 where an input was refused."""
    from pipeline.package_groups import require_group
    from stages.programs.program import find_program
    from stages.recovery.files import write_recovery
    from stages.recovery.inputs import InputError
    from stages.recovery.reading import read_inputs
    from stages.recovery.recover import recover_input
    from stages.training.recovery.trained import PRETRAINED_FOLDER, find_models

    require_group("models")
    if program:
        find_program(program)
    models, problems = find_models(out, PRETRAINED_FOLDER)
    for problem in problems:
        print(f"left out: {problem}", file=sys.stderr)
    refused = 0
    try:
        for item in read_inputs(source):
            if isinstance(item, InputError):
                print(item, file=sys.stderr)
                refused += 1
                continue
            result = recover_input(item, program, models, up.value, budget, seed)
            distances = f"distance {result.distance:.2g}, base {result.base_distance:.2g}"
            print(f"{item.name}: {result.program.name}, {distances}")
            for warning in result.warnings:
                print(f"{item.name}: {warning}", file=sys.stderr)
            for path in write_recovery(out / "recovered", item, result):
                print(f"  {path}")
    except InputError as error:
        raise ConfigError(str(error)) from error
    raise typer.Exit(1 if refused else 0)
