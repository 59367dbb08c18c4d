"""Print a table of models, each inspected by itself: python -m stages.inspection MODEL..."""

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

HEADER = ("model", "parts", "types", "up", "tolerance", "kinds", "grammar", "hubs", "kept", "graphs", "histograms",
          "distance", "CPU s", "yield estimate")  # fmt: skip


def main() -> None:
    """Print a Markdown table, a row for each model as soon as it is inspected."""
    parser = argparse.ArgumentParser(prog="python -m stages.inspection", description=__doc__)
    parser.add_argument("models", nargs="+", type=Path, metavar="MODEL")
    tries = AutoconfigConfig().max_tries
    parser.add_argument("--tries", type=int, default=tries, help="as autoconfig.max_tries in a config")
    options = parser.parse_args()
    print(f"| {' | '.join(HEADER)} |\n|{'---|' * len(HEADER)}", flush=True)
    for path in options.models:
        try:
            config = KitConfig(name="inspected", shapes=(path,))
            report = inspect_models(config, [read_model(path)], options.tries)
            print(f"| {' | '.join(_row(dataset_name([path]), report))} |", flush=True)
        except ConfigError as error:
            print(error, file=sys.stderr)


def _row(name: str, report: InspectionReport) -> Iterator[str]:
    settings, kit = report.config.resolved(), report.observed.kit
    yield name
    yield str(sum(len(exemplar.assembly) for exemplar in kit.exemplars))
    yield str(len(kit.types))
    yield settings.up
    yield f"{settings.tolerance:g}"
    yield ", ".join(settings.kinds)
    yield settings.grammar
    yield ", ".join(settings.hubs) or "none"
    yield f"{report.resolution.kept_share:.0%}"
    trial = report.layouts.trial if report.layouts is not None else None
    yield f"{trial.graphs:,}" if trial else "0"
    yield f"{trial.histograms:,}" if trial else "0"
    yield f"{trial.distance:.2f}" if trial else ""
    yield f"{report.seconds:.0f}"
    yield report.sentence


if __name__ == "__main__":
    main()
