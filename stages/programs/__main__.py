"""Programs from the command line: `python -m stages.programs inspect|movement|sheet|make|mix|interpolate PROGRAM ...`.

A SHAPE is a JSON file of parameters, such as `make recover` writes, a whole number (the random shape of that seed), or
`base`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.errors import ConfigError, ShardFailed
from pipeline.paths import write_file
from stages.programs.description import program_markdown
from stages.programs.editing import interpolate, mix
from stages.programs.files import named_values, random_shapes, shape_glb
from stages.programs.movement import movement_table, movements
from stages.programs.parameters import ParameterError
from stages.programs.program import Program, find_program
from stages.programs.schema import Values
from stages.programs.sheets import parameter_sheet, shape_sheet
from stages.shape.views.sheet import picture_png

OUT = Path("datasets", "programs")
"""Where files go if nobody says where."""


def main(arguments: list[str]) -> int:
    """Run one command. Returns the exit code: 0, or 2 for a mistake in what was asked."""
    asked = _parser().parse_args(arguments)
    try:
        program = find_program(asked.program)
        for path in asked.run(program, asked):
            print(path)
    except (ConfigError, ParameterError, ShardFailed) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _inspect(program: Program, asked: argparse.Namespace) -> list[Path]:
    print(program_markdown(program))
    sys.stdout.flush()
    picture = asked.picture or asked.out / f"{program.name}.png"
    return [write_file(picture, picture_png(parameter_sheet(program)))]


def _movement(program: Program, asked: argparse.Namespace) -> list[Path]:
    print(movement_table(list(movements(program, asked.count, asked.seed))), end="")
    return []


def _sheet(program: Program, asked: argparse.Namespace) -> list[Path]:
    shapes = random_shapes(program, asked.count, asked.seed)
    sheet = shape_sheet(program, shapes, [""] * len(shapes), f"{program.name}: {asked.count} random shapes")
    return [write_file(asked.picture or asked.out / f"{program.name}-{asked.seed}.png", picture_png(sheet))]


def _make(program: Program, asked: argparse.Namespace) -> list[Path]:
    shapes = [named_values(program, name) for name in asked.shapes]
    return _written(program, asked, shapes, [Path(name).stem for name in asked.shapes], program.name)


def _mix(program: Program, asked: argparse.Namespace) -> list[Path]:
    target, source = named_values(program, asked.target), named_values(program, asked.source)
    mixed = mix(program, target, source, asked.group)
    title = f"{program.name}: {', '.join(asked.group)} of the second on the first"
    return _written(program, asked, [target, source, mixed], ["target", "source", "mixed"], title)


def _interpolate(program: Program, asked: argparse.Namespace) -> list[Path]:
    first, last = named_values(program, asked.first), named_values(program, asked.last)
    shares = [step / (asked.steps - 1) for step in range(asked.steps)]
    shapes = [interpolate(program, first, last, share, asked.group) for share in shares]
    names = [f"step-{number:02d}" for number in range(asked.steps)]
    title = f"{program.name}: from one shape to another"
    return _written(program, asked, shapes, names, f"{title}, {', '.join(asked.group)} alone" if asked.group else title)


def _written(
    program: Program, asked: argparse.Namespace, shapes: Sequence[Values], names: Sequence[str], title: str
) -> list[Path]:
    """A GLB and a JSON of each shape, and a sheet of all."""
    written = []
    for name, values in zip(names, shapes, strict=True):
        written.append(write_file(asked.out / f"{name}.glb", shape_glb(program, values)))
        text = json.dumps(json.loads(program.schema.to_text(values)), indent=1, ensure_ascii=False) + "\n"
        written.append(write_file(asked.out / f"{name}.json", text.encode()))
    sheet = shape_sheet(program, shapes, names, title)
    return [*written, write_file(asked.out / "sheet.png", picture_png(sheet))]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stages.programs", description=__doc__)
    commands = parser.add_subparsers(required=True)

    def command(name: str, run: object, purpose: str) -> argparse.ArgumentParser:
        added = commands.add_parser(name, help=purpose, description=purpose)
        added.add_argument("program", metavar="PROGRAM", help="name of the program, or the module that holds one")
        added.add_argument("--out", type=Path, default=OUT, help="folder that files go to")
        added.set_defaults(run=run)
        return added

    inspect = command("inspect", _inspect, "Print the table of parameters, and draw one row a parameter.")
    inspect.add_argument("--picture", type=Path, metavar="FILE", help="where the PNG goes")
    movement = command("movement", _movement, "Print how far each parameter moves the surface of random shapes.")
    movement.add_argument("--count", type=_count, default=40, help="so many shapes in which a parameter is visible")
    movement.add_argument("--seed", type=int, default=0, help="which")
    sheet = command("sheet", _sheet, "Draw random shapes.")
    sheet.add_argument("--count", type=_count, default=64, help="how many")
    sheet.add_argument("--seed", type=int, default=0, help="which")
    sheet.add_argument("--picture", type=Path, metavar="FILE", help="where the PNG goes")
    make = command("make", _make, "Make single shapes.")
    make.add_argument("shapes", nargs="+", metavar="SHAPE")
    mixing = command("mix", _mix, "Copy groups of parameters from one shape to another.")
    mixing.add_argument("target", metavar="SHAPE", help="the shape that is changed")
    mixing.add_argument("source", metavar="SHAPE", help="the shape that they are copied from")
    mixing.add_argument("--group", action="append", required=True, help="a group of parameters; may be given again")
    between = command("interpolate", _interpolate, "Go from one shape to another in steps.")
    between.add_argument("first", metavar="SHAPE")
    between.add_argument("last", metavar="SHAPE")
    between.add_argument("--steps", type=_count, default=6, help="how many shapes, both ends among them")
    between.add_argument(
        "--group", action="append", default=[], help="a group of parameters that moves alone; may be given again"
    )
    return parser


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 2:
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number from 2")
    return int(text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
