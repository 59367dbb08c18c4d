"""Commands of this room; see `pipeline/options.py`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from pipeline.options import (
    DEFAULT_CONFIG,
    DEFAULT_OUT,
    DEFAULT_WORKERS,
    EVALUATION,
    ConfigOption,
    OutOption,
    WorkersOption,
)

COMMANDS = typer.Typer()


@COMMANDS.command("eval", rich_help_panel=EVALUATION)
def make_tables(
    table: Annotated[str, typer.Argument(help="its name, or all; without, tables are listed")] = "",
    files: Annotated[list[Path] | None, typer.Argument(help="models or boxes instead of the dataset")] = None,
    settings: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="option of a table")] = None,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
) -> None:
    """Print a table about a dataset or files, and keep it; without a name, list the tables and their options.

    `all` makes every table that can be made, and the report. Exits with 1 if one of them fails.
    """
    # Threads that wait without sleeping take up to a hundred times the processor's time on a busy machine.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    from eval.engine.dataset_run import load_dataset_run
    from eval.engine.evaluate import (
        ALL_TABLES,
        list_tables,
        make_all_tables,
        make_table,
        print_table_of_files,
        read_settings,
    )

    values = read_settings(settings or ())
    if files:
        print_table_of_files(table, files, out, values)
        return
    run = load_dataset_run(config, out, workers)
    if table == ALL_TABLES:
        if make_all_tables(run, values):
            raise typer.Exit(1)
    elif table:
        make_table(run, table, values)
    else:
        print(list_tables(run), end="")
