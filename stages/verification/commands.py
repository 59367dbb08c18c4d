"""`shapemill verify` and `shapemill reproduce`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.display import ticking
from pipeline.errors import ConfigError
from pipeline.options import (
    DEFAULT_CONFIG,
    DEFAULT_OUT,
    DEFAULT_WORKERS,
    INSPECTION,
    ConfigOption,
    OutOption,
    SeedOption,
    WorkersOption,
    load_dataset,
    print_corrupted,
)
from pipeline.registry import find_stages

COMMANDS = typer.Typer()
EXEMPLARS = Path("datasets/exemplars")
"""Folder of the exemplars that come with the project."""


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


@COMMANDS.command(rich_help_panel=INSPECTION)
def reproduce(
    context: typer.Context,
    shard: Annotated[str, typer.Argument(help="split and number, such as train-000007", show_default=False)],
    folder: Annotated[
        Path | None, typer.Argument(help="a dataset's folder; without, that of the config", show_default=False)
    ] = None,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    models: Annotated[
        list[Path] | None, typer.Option(help="folder with the models that the dataset was made from")
    ] = None,
    workers: WorkersOption = DEFAULT_WORKERS,
) -> None:
    """Make one shard of a published dataset again, from its manifest alone, and compare the bytes."""
    from pipeline.termination import exit_on_signals
    from stages.verification.reproduce import reproduce_shard

    if folder is None:
        stages, loaded, _ = load_dataset(context, config, out)
        folder = out / loaded.name
    else:
        stages = find_stages(context.obj)
    with exit_on_signals():
        faults = list(reproduce_shard(folder, shard, stages, models or [EXEMPLARS], workers))
    for fault in faults:
        print(f"{shard}: {fault}")
    if not faults:
        print(f"{shard}: reproduced, with the same bytes as published")
    raise typer.Exit(int(bool(faults)))
