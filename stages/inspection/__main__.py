"""A table of many models, each looked at by itself: what is chosen for it, and what it will give.

python -m stages.autoconfig MODEL...
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import ConfigError
from stages.autoconfig.settings import AutoconfigConfig
from stages.exemplars.read import read_model
from stages.exemplars.settings import KitConfig
from stages.inspection.config_text import dataset_name
from stages.inspection.report import InspectionReport, inspect_models

HEADER = ("model", "parts", "types", "up", "tolerance", "kinds", "grammar", "hubs", "stay", "graphs", "histograms",
          "distance", "CPU s", "forecast")  # fmt: skip


def main() -> None:
    """Print a Markdown table, a row for each model as soon as it is looked at."""
    parser = argparse.ArgumentParser(prog="python -m stages.autoconfig", description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="+", type=Path, metavar="MODEL")
    parser.add_argument(
        "--tries", type=int, default=AutoconfigConfig().max_tries, help="as autoconfig.max_tries in a config"
    )
    asked = parser.parse_args()
    print(f"| {' | '.join(HEADER)} |\n|{'---|' * len(HEADER)}", flush=True)
    for path in asked.models:
        try:
            config = KitConfig(name="inspected", shapes=(path,))
            found = inspect_models(config, [read_model(path)], asked.tries)
            print(f"| {' | '.join(_row(dataset_name([path]), found))} |", flush=True)
        except ConfigError as error:
            print(error, file=sys.stderr)


def _row(name: str, found: InspectionReport) -> Iterator[str]:
    made, seen = found.config.resolved(), found.seen.kit
    yield name
    yield str(sum(len(each.assembly) for each in seen.exemplars))
    yield str(len(seen.types))
    yield made.up
    yield f"{made.tolerance:g}"
    yield ", ".join(made.kinds)
    yield made.grammar
    yield ", ".join(made.hubs) or "none"
    yield f"{found.choices.kept:.0%}"
    finds = found.yield_estimate.finds if found.yield_estimate is not None else None
    yield f"{finds.graphs:,}" if finds else "0"
    yield f"{finds.histograms:,}" if finds else "0"
    yield f"{finds.distance:.2f}" if finds else ""
    yield f"{found.seconds:.0f}"
    yield found.sentence


if __name__ == "__main__":
    main()
