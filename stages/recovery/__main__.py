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
from stages.recovery.reading import InputError, read_inputs
from stages.recovery.recover import PRETRAINED_FOLDER, find_models, recover_input


def main(arguments: list[str]) -> int:
    """Recover all inputs. Returns the exit code: 0, 1 where some were none, 2 for a mistake in what was asked."""
    asked = _parser().parse_args(arguments)
    refused = 0
    try:
        if asked.program:
            find_program(asked.program)
        models, wrong = find_models(asked.out, PRETRAINED_FOLDER)
        for text in wrong:
            print(f"left out: {text}", file=sys.stderr)
        for given in read_inputs(asked.input):
            if isinstance(given, InputError):
                print(given, file=sys.stderr)
                refused += 1
                continue
            found = recover_input(given, asked.program, models, asked.up, asked.budget, asked.seed)
            print(f"{given.name}: {found.program.name}, distance {found.distance:.2g}, base {found.base_distance:.2g}")
            for warning in found.warnings:
                print(f"{given.name}: {warning}", file=sys.stderr)
            for path in write_recovery(asked.out / "recovered", given, found):
                print(f"  {path}")
    except (ConfigError, InputError) as error:
        print(error, file=sys.stderr)
        return 2
    return 1 if refused else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stages.recovery", description=__doc__)
    parser.add_argument("input", type=Path, metavar="INPUT")
    parser.add_argument("--program", default="", help="name of the program; the likeliest unless you say")
    parser.add_argument("--up", default="", choices=["", "x", "y", "z"], help="the axis of clouds that points up")
    parser.add_argument("--out", type=Path, default=Path("datasets"), help="where models are, and results go")
    parser.add_argument("--budget", type=_count, default=600, help="shapes that are made for an input at most")
    parser.add_argument("--seed", type=_seed, default=0, help="where chance starts")
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
