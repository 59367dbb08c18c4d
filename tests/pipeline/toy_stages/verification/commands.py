"""A room's command, which checks what the engine has written and then something of its own."""

from __future__ import annotations

import typer

from pipeline.options import (
    DEFAULT_CONFIG,
    DEFAULT_OUT,
    INSPECTION,
    ConfigOption,
    OutOption,
    load_dataset,
    print_corrupted,
)

COMMANDS = typer.Typer()


@COMMANDS.command(rich_help_panel=INSPECTION)
def verify(
    context: typer.Context, config: ConfigOption = DEFAULT_CONFIG, out: OutOption = DEFAULT_OUT, samples: int = 100
) -> None:
    """Print what it was asked; fail where a file is corrupted."""
    stages, loaded, paths = load_dataset(context, config, out)
    corrupted = print_corrupted(stages, loaded, paths)
    print("verify", loaded.name, samples)
    raise typer.Exit(int(corrupted))
