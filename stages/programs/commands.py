"""`shapemill programs`: inspect, draw, make, mix and interpolate shapes of a program."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.errors import ConfigError, ShardFailed
from pipeline.options import INSPECTION

if TYPE_CHECKING:
    from stages.programs.program import Program
    from stages.programs.schema import Values
    from stages.shape.arrays import ByteArray

DEFAULT_FOLDER = Path("datasets", "programs")
SHAPE_HELP = "a JSON file of parameters, such as recover writes; the seed of a random shape; or base"

ProgramArgument = Annotated[str, typer.Argument(metavar="PROGRAM", help="name of a program, or the module that has it")]
ShapeArgument = Annotated[str, typer.Argument(metavar="SHAPE", help=SHAPE_HELP)]
FolderOption = Annotated[Path, typer.Option("--out", help="folder that files are written to")]
PictureOption = Annotated[Path | None, typer.Option("--picture", metavar="FILE", help="file of the picture, PNG")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="seed of the random shapes")]

COMMANDS = typer.Typer()
PROGRAMS = typer.Typer(no_args_is_help=True)
COMMANDS.add_typer(
    PROGRAMS, name="programs", rich_help_panel=INSPECTION, help="Inspect, draw, mix and interpolate shape programs."
)


@PROGRAMS.command()
def inspect(program: ProgramArgument, picture: PictureOption = None, out: FolderOption = DEFAULT_FOLDER) -> None:
    """Print the table of parameters, and draw one row per parameter."""
    from stages.programs.description import program_markdown
    from stages.programs.sheets import parameter_sheet

    with _program(program) as found:
        print(program_markdown(found))
        sys.stdout.flush()
        _write_picture(picture or out / f"{found.name}.png", parameter_sheet(found))


@PROGRAMS.command()
def movement(
    program: ProgramArgument,
    count: Annotated[int, typer.Option(min=2, help="number of shapes in which a parameter is visible")] = 40,
    seed: SeedOption = 0,
) -> None:
    """Print how far each parameter moves the surface of random shapes."""
    from stages.programs.movement import movement_table, movements

    with _program(program) as found:
        print(movement_table(list(movements(found, count, seed))), end="")


@PROGRAMS.command()
def sheet(
    program: ProgramArgument,
    count: Annotated[int, typer.Option(min=2, help="number of shapes")] = 64,
    seed: SeedOption = 0,
    picture: PictureOption = None,
    out: FolderOption = DEFAULT_FOLDER,
) -> None:
    """Draw random shapes."""
    from stages.programs.files import random_shapes
    from stages.programs.sheets import shape_sheet

    with _program(program) as found:
        shapes = random_shapes(found, count, seed)
        drawn = shape_sheet(found, shapes, [""] * count, f"{found.name}: {count} random shapes")
        _write_picture(picture or out / f"{found.name}-{seed}.png", drawn)


@PROGRAMS.command()
def make(
    program: ProgramArgument,
    shapes: Annotated[list[str], typer.Argument(metavar="SHAPE...", help=SHAPE_HELP)],
    out: FolderOption = DEFAULT_FOLDER,
) -> None:
    """Write shapes as GLB and JSON files, and a picture of all."""
    from stages.programs.files import named_values

    with _program(program) as found:
        values = [named_values(found, name) for name in shapes]
        _write_shapes(found, out, values, [Path(name).stem for name in shapes], found.name)


@PROGRAMS.command()
def mix(
    program: ProgramArgument,
    target: ShapeArgument,
    source: ShapeArgument,
    group: Annotated[list[str], typer.Option(help="a group of parameters; may be given several times")],
    out: FolderOption = DEFAULT_FOLDER,
) -> None:
    """Copy groups of parameters from a second shape to a first."""
    from stages.programs.editing import mix_values
    from stages.programs.files import named_values

    with _program(program) as found:
        ends = named_values(found, target), named_values(found, source)
        title = f"{found.name}: {', '.join(group)} of the second on the first"
        _write_shapes(found, out, [*ends, mix_values(found, *ends, group)], ["target", "source", "mixed"], title)


@PROGRAMS.command()
def interpolate(
    program: ProgramArgument,
    first: ShapeArgument,
    last: ShapeArgument,
    steps: Annotated[int, typer.Option(min=2, help="number of shapes, both ends included")] = 6,
    group: Annotated[list[str] | None, typer.Option(help="change this group alone; may be given several times")] = None,
    out: FolderOption = DEFAULT_FOLDER,
) -> None:
    """Interpolate the parameters between two shapes."""
    from stages.programs.editing import interpolate
    from stages.programs.files import named_values

    groups = group or []
    with _program(program) as found:
        ends = named_values(found, first), named_values(found, last)
        shapes = [interpolate(found, *ends, step / (steps - 1), groups) for step in range(steps)]
        title = f"{found.name}: from one shape to another" + (f", {', '.join(groups)} alone" if groups else "")
        _write_shapes(found, out, shapes, [f"step-{number:02d}" for number in range(steps)], title)


@contextmanager
def _program(name: str) -> Iterator[Program]:
    """The program of a name; mistakes in parameters and programs without shapes become ConfigErrors."""
    from stages.programs.parameters import ParameterError
    from stages.programs.program import find_program

    try:
        yield find_program(name)
    except (ParameterError, ShardFailed) as error:
        raise ConfigError(str(error)) from error


def _write_picture(path: Path, picture: ByteArray) -> None:
    from pipeline.paths import write_file
    from stages.shape.views.sheet import picture_png

    print(write_file(path, picture_png(picture)))


def _write_shapes(program: Program, out: Path, shapes: Sequence[Values], names: Sequence[str], title: str) -> None:
    """Write a GLB and a JSON file of each shape, and a sheet of all; print their paths."""
    from pipeline.paths import write_file
    from stages.programs.files import shape_glb
    from stages.programs.sheets import shape_sheet

    for name, values in zip(names, shapes, strict=True):
        text = json.dumps(json.loads(program.schema.to_text(values)), indent=1, ensure_ascii=False) + "\n"
        print(write_file(out / f"{name}.glb", shape_glb(program, values)))
        print(write_file(out / f"{name}.json", text.encode()))
    _write_picture(out / "sheet.png", shape_sheet(program, shapes, names, title))
