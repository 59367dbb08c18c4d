"""`shapemill publish`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.options import DATASETS, DEFAULT_CONFIG, DEFAULT_OUT, ConfigOption, OutOption, load_dataset

COMMANDS = typer.Typer()


@COMMANDS.command(rich_help_panel=DATASETS)
def publish(
    context: typer.Context,
    destination: Annotated[str, typer.Argument(help="a folder, s3://bucket/name, or hf://organization/name")],
    folder: Annotated[
        Path | None, typer.Argument(help="a dataset's folder; without, that of the config", show_default=False)
    ] = None,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="list what would be sent, and send nothing")] = False,
) -> None:
    """Put a finished, verified dataset where people load it; what is there with the same bytes is not sent again."""
    from pipeline.termination import exit_on_signals
    from stages.publishing.publish import publish_dataset

    folder = folder or out / load_dataset(context, config, out)[1].name
    with exit_on_signals():
        publish_dataset(folder, destination, dry_run)
