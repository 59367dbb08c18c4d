"""`shapemill sheets`."""

from __future__ import annotations

import typer

from pipeline.options import DEFAULT_CONFIG, DEFAULT_OUT, INSPECTION, ConfigOption, OutOption, SeedOption, load_dataset

COMMANDS = typer.Typer()


@COMMANDS.command(rich_help_panel=INSPECTION)
def sheets(
    context: typer.Context,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = None,
) -> None:
    """Draw contact sheets of the variations of each kit, and of what replaced what."""
    from stages.variations.report.sheet import write_sheets

    _, loaded, paths = load_dataset(context, config, out, seed)
    for path in write_sheets(loaded, paths):
        print(path)
