"""`make bench`: measures every piece beside a public peer in the same run, and prints one Markdown table.

python -m tests.bench [--json FILE] [PIECE...]   (a piece is the part of a file name after `bench_`)
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from tests.bench.measure import Measure

__all__ = ["measures", "row"]

HEADER = "| what | ours, a second and core | peer | ratio | note |\n|---|---:|---:|---:|---|"


def measures(pieces: list[str]) -> Iterator[Measure]:
    """The measures of the named pieces, of all if none is named, as they come."""
    found = sorted(path.stem.removeprefix("bench_") for path in Path(__file__).parent.glob("bench_*.py"))
    unknown = set(pieces) - set(found)
    if unknown:
        sys.exit(f"there is no piece {', '.join(sorted(unknown))}; pieces are {', '.join(found)}")
    for piece in pieces or found:
        yield from importlib.import_module(f"tests.bench.bench_{piece}").bench()


def row(measure: Measure) -> str:
    """One measure as a row of the table."""
    peer = f"{_figure(measure.peer)} ({measure.peer_name})" if measure.peer is not None else "–"
    ratio = f"{measure.ours / measure.peer:.2g}×" if measure.peer else "–"
    return f"| {measure.name} | {_figure(measure.ours)} {measure.unit} | {peer} | {ratio} | {measure.note} |"


def _figure(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def main() -> None:
    """Measure, print the table, write the JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description="Measure every piece beside a peer.")
    parser.add_argument("pieces", nargs="*", help="pieces to measure; all if none is named")
    parser.add_argument("--json", type=Path, help="also write the measures to this file")
    asked = parser.parse_args()
    made: list[Measure] = []
    print(HEADER, flush=True)
    for measure in measures(asked.pieces):
        made.append(measure)
        print(row(measure), flush=True)
    if asked.json is not None:
        asked.json.write_text(json.dumps([asdict(measure) for measure in made], indent=1) + "\n")


if __name__ == "__main__":
    main()
