"""Commands of this room; see `pipeline/options.py`."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from pipeline.options import (
    DEFAULT_CONFIG,
    DEFAULT_OUT,
    DEFAULT_WORKERS,
    EVALUATION,
    SYSTEM,
    ConfigOption,
    OutOption,
    WorkersOption,
)

COMMANDS = typer.Typer()


@COMMANDS.command("eval", rich_help_panel=EVALUATION)
def make_tables(
    table: Annotated[str, typer.Argument(help="its name, or all; without, tables are listed")] = "",
    files: Annotated[list[str] | None, typer.Argument(help="models or boxes instead of the dataset")] = None,
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
        from stages.model_files.folder import model_paths

        paths = [path for text in files for path in model_paths(text)]
        print_table_of_files(table, paths, out, values, workers)
        return
    run = load_dataset_run(config, out, workers)
    if table == ALL_TABLES:
        if make_all_tables(run, values):
            raise typer.Exit(1)
    elif table:
        make_table(run, table, values)
    else:
        print(list_tables(run), end="")


@COMMANDS.command("paper", rich_help_panel=EVALUATION)
def report_paper(
    paper: Annotated[str, typer.Argument(help="its short name, or all; without, papers are listed")] = "",
    scale: Annotated[str, typer.Option("--scale", help="how large: minutes, hours or full")] = "minutes",
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
) -> None:
    """Make what the tables and figures of a paper need, and one report of them, next to the published figures.

    Exits with 1 if a step fails; data that is not available here is stated in the report, and the rest goes on.
    """
    from eval.papers.make_paper import list_papers, make_paper
    from eval.papers.paper import ALL_PAPERS, PAPERS, known_scale, load_paper
    from pipeline.package_groups import require_group

    if not paper:
        print(list_papers(), end="")
        return
    chosen = known_scale(scale)
    names = PAPERS if paper == ALL_PAPERS else (paper,)
    for name in names:
        load_paper(name)
    require_group("models")
    if sum(make_paper(name, chosen, out, workers) for name in names):
        raise typer.Exit(1)


@COMMANDS.command("results", rich_help_panel=SYSTEM)
def write_results() -> None:
    """Write eval/RESULTS.md and eval/RESULTS.html, the page of all papers, from eval/papers."""
    from eval.papers.results_page import HTML_PAGE, RESULTS_PAGE, results_html, results_page
    from pipeline.paths import write_file

    print(write_file(RESULTS_PAGE, results_page().encode()))
    print(write_file(HTML_PAGE, results_html().encode()))
