"""Recovery from the command line: `python -m stages.recovery INPUT`.

INPUT is a cloud, a mesh, a drawing, a folder of them, or a shard of a dataset.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pipeline.errors import ConfigError
from stages.programs.program import find_program
from stages.recovery.files import write_recovery
from stages.recovery.inputs import InputError
from stages.recovery.reading import read_inputs
from stages.recovery.recover import DEFAULT_BUDGET_SHAPES, recover_input
from stages.training.recovery.trained import PRETRAINED_FOLDER, find_models


def main(arguments: list[str]) -> int:
    """Recover all inputs. Returns the exit code: 0, 1 where inputs were refused, 2 for a mistake in the command."""
    options = _parser().parse_args(arguments)
    refused = 0
    try:
        if options.program:
            find_program(options.program)
        models, problems = find_models(options.out, PRETRAINED_FOLDER)
        for problem in problems:
            print(f"left out: {problem}", file=sys.stderr)
        for source in read_inputs(options.input):
            if isinstance(source, InputError):
                print(source, file=sys.stderr)
                refused += 1
                continue
            result = recover_input(source, options.program, models, options.up, options.budget, options.seed)
            distances = f"distance {result.distance:.2g}, base {result.base_distance:.2g}"
            print(f"{source.name}: {result.program.name}, {distances}")
            for warning in result.warnings:
                print(f"{source.name}: {warning}", file=sys.stderr)
            for path in write_recovery(options.out / "recovered", source, result):
                print(f"  {path}")
    except (ConfigError, InputError) as error:
        print(error, file=sys.stderr)
        return 2
    return 1 if refused else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stages.recovery", description=__doc__)
    parser.add_argument("input", type=Path, metavar="INPUT")
    parser.add_argument("--program", default="", help="name of the program; the likeliest by default")
    parser.add_argument("--up", default="", choices=["", "x", "y", "z"], help="the axis of clouds that points up")
    parser.add_argument("--out", type=Path, default=Path("datasets"), help="where models are, and results go")
    parser.add_argument("--budget", type=_count, default=DEFAULT_BUDGET_SHAPES, help="most shapes built for an input")
    parser.add_argument("--seed", type=_seed, default=0, help="seed of the search")
    return parser


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text} is no seed: a whole number from 0 on")
    return int(text)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number from 1")
    return int(text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
