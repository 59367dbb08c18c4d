"""`make bench`: measures every piece and a public peer in the same run, and prints one Markdown table.

It marks what differs from the last kept report, `tests/bench/report.md`, by more than noise.

python -m tests.bench [--json FILE] [--keep] [PIECE...]   (a piece is the part of a file name after `bench_`)
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from tests.bench.kept import TABLE_HEADER, figures, keep, row
from tests.bench.measure import Measure

KEPT_REPORT = Path(__file__).parent / "report.json"


def measures(pieces: list[str]) -> Iterator[Measure]:
    """Yield the measures of the named pieces, or of all."""
    found = sorted(path.stem.removeprefix("bench_") for path in Path(__file__).parent.glob("bench_*.py"))
    unknown = set(pieces) - set(found)
    if unknown:
        sys.exit(f"there is no piece {', '.join(sorted(unknown))}; pieces are {', '.join(found)}")
    for piece in pieces or found:
        yield from importlib.import_module(f"tests.bench.bench_{piece}").bench()


def main() -> None:
    """Measure, print the table, write the JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description="Measure every piece and a peer.")
    parser.add_argument("pieces", nargs="*", help="pieces to measure; all if none is named")
    parser.add_argument("--json", type=Path, help="also write the measures to this file")
    parser.add_argument(
        "--keep", action="store_true", help="make this the kept report, tests/bench/report.md and .json"
    )
    arguments = parser.parse_args()
    made: list[Measure] = []
    kept = figures(KEPT_REPORT)
    print(TABLE_HEADER, flush=True)
    for measure in measures(arguments.pieces):
        made.append(measure)
        print(row(measure, kept), flush=True)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps([asdict(measure) for measure in made], indent=1) + "\n", encoding="utf-8")
    if arguments.keep:
        keep(KEPT_REPORT, made)


if __name__ == "__main__":
    main()
