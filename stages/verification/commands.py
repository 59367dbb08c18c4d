"""`shapemill verify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.display import ticking
from pipeline.errors import ConfigError
from pipeline.options import (
    DEFAULT_CONFIG,
    DEFAULT_OUT,
    INSPECTION,
    ConfigOption,
    OutOption,
    SeedOption,
    WorkersOption,
    load_dataset,
    print_corrupted,
)

COMMANDS = typer.Typer()


@COMMANDS.command(rich_help_panel=INSPECTION)
def verify(
    context: typer.Context,
    folder: Annotated[
        Path | None, typer.Argument(help="a dataset's folder; without, that of the config", show_default=False)
    ] = None,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = None,
    workers: WorkersOption = 1,
    samples: Annotated[str, typer.Option(help="number of samples checked by independent means, or all")] = "100",
) -> None:
    """Check a finished dataset: every file and sample, and some samples by independent means."""
    from stages.verification.verify import print_findings

    if samples != "all" and not samples.isdecimal():
        raise ConfigError(f"--samples {samples}: must be a whole number from 0, or all")
    count = None if samples == "all" else int(samples)
    corrupted = False
    if folder is None:
        stages, loaded, paths = load_dataset(context, config, out, seed)
        with ticking("verify", "comparing files with their records"):
            corrupted = print_corrupted(stages, loaded, paths)
        folder = out / loaded.name
    raise typer.Exit(print_findings(folder, count, seed or 0, workers) or int(corrupted))
