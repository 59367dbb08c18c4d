"""The command line, `shapemill` or `python -m pipeline`: the engine's commands, and those of every `commands.py`.

Exit codes: 0 all is well; 1 shards failed, or something that was checked is not as it should be; 2 nothing started,
because of a mistake in the config or the command; 3 everything had to stop (disk full, no permission); 130 stopped by
Ctrl-C; 143 by SIGTERM, 129 by SIGHUP.
"""

from __future__ import annotations

import importlib
import io
import re
import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from pipeline.compilation_note import show_compilation
from pipeline.config import nearest_word
from pipeline.errors import ConfigError, Fatal
from pipeline.options import (
    DATASETS,
    DEFAULT_CONFIG,
    DEFAULT_OUT,
    DEFAULT_WORKERS,
    SYSTEM,
    ClusterOption,
    ConfigOption,
    OnlyOption,
    OutOption,
    RunOutOption,
    SeedOption,
    StallOption,
    WorkersOption,
    WorkOption,
    load_dataset,
    run_or_exit,
)
from pipeline.package_groups import missing_group
from pipeline.registry import find_stages, folders_with
from pipeline.remote_output import open_remote_output, store_url
from pipeline.stall_timeout import DEFAULT_STALL_MINUTES

DATASET_COMMANDS = typer.Typer()
SYSTEM_COMMANDS = typer.Typer()


@DATASET_COMMANDS.command(rich_help_panel=DATASETS)
def run(
    context: typer.Context,
    stage: Annotated[str, typer.Argument(help="one stage; without, the whole dataset", show_default=False)] = "",
    config: ConfigOption = DEFAULT_CONFIG,
    out: RunOutOption = DEFAULT_OUT,
    work: WorkOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
    seed: SeedOption = None,
    shards: Annotated[str, typer.Option(help="part i of n, from 1, as one job of a job array: i/n")] = "1/1",
    retries: Annotated[int, typer.Option(min=0, help="how often a failed shard is tried again")] = 2,
    only: OnlyOption = "",
    stall_timeout: StallOption = DEFAULT_STALL_MINUTES,
    cluster: ClusterOption = "",
) -> None:
    """Make a dataset, or one stage of it: whatever is missing or outdated."""
    from pipeline.slices import Slice

    part = Slice(*_slice(shards))
    stages = find_stages(context.obj)
    if stage and stage not in stages:
        close = nearest_word(stage, stages)
        hint = f"did you mean {close}?" if close else f"stages are {', '.join(stages)}"
        raise ConfigError(f"there is no stage {stage}; {hint}")
    url = store_url(out)
    _, loaded, paths = load_dataset(context, config, work if url else out, seed)
    names = [stage] if stage else [name for name in stages if not stages[name].publishes_incomplete]
    options = {"part": part, "retries": retries, "only": only, "stall_minutes": stall_timeout, "cluster": cluster}
    if url:
        options["output"] = open_remote_output(url, loaded.name, paths)
    run_or_exit(names, stages, loaded, paths, workers, **options)


@DATASET_COMMANDS.command(rich_help_panel=DATASETS)
def plan(
    context: typer.Context,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
    seed: SeedOption = None,
) -> None:
    """Estimate shards, samples, disk and time of a dataset before it starts; runs a short trial where needed."""
    from pipeline.estimate import plan_lines

    stages, loaded, paths = load_dataset(context, config, out, seed)
    for line in plan_lines(loaded, stages, paths, workers):
        print(line, flush=True)


@DATASET_COMMANDS.command(rich_help_panel=DATASETS)
def status(
    context: typer.Context,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
    seed: SeedOption = None,
) -> None:
    """Show what is done, failed, rejected and left, stage by stage."""
    from pipeline.status import status_lines

    stages, loaded, paths = load_dataset(context, config, out, seed)
    for line in status_lines(loaded, stages, paths, workers):
        print(line)


@DATASET_COMMANDS.command(rich_help_panel=DATASETS)
def clean(context: typer.Context, config: ConfigOption = DEFAULT_CONFIG, out: OutOption = DEFAULT_OUT) -> None:
    """Delete a dataset's work folder, its records and shards; the finished dataset stays."""
    _, _, paths = load_dataset(context, config, out)
    if paths.work.is_dir():
        shutil.rmtree(paths.work)
    print(f"removed {paths.work}")


@SYSTEM_COMMANDS.command(rich_help_panel=SYSTEM)
def doctor(out: OutOption = DEFAULT_OUT) -> None:
    """Try everything that Shapemill needs on this machine, with the remedy for what fails."""
    from pipeline.doctor import examine

    raise typer.Exit(examine(out))


@SYSTEM_COMMANDS.command(rich_help_panel=SYSTEM)
def cluster(
    workers: WorkersOption = DEFAULT_WORKERS,
    port: Annotated[int, typer.Option(min=1, max=65535, help="port of the scheduler, on this machine alone")] = 8786,
) -> None:
    """Start a scheduler and workers on this machine, for runs with --cluster; Ctrl-C ends them."""
    from pipeline.local_cluster import serve_cluster

    raise typer.Exit(serve_cluster(workers, port))


@SYSTEM_COMMANDS.command(rich_help_panel=SYSTEM)
def config_docs(context: typer.Context) -> None:
    """Write the keys of every config section into its page in configs/sections."""
    from pipeline.config_docs import write_config_pages

    write_config_pages(Path("configs/sections"), find_stages(context.obj))


def _slice(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    index, count = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= index <= count:
        raise ConfigError(f"--shards {text}: must be i/n with 1 <= i <= n, such as 2/8")
    return index, count


def command_line(*packages: str) -> typer.Typer:
    """Return the whole command line: the engine's commands and those that the packages' folders hold."""
    app = typer.Typer(
        name="shapemill",
        help="Make large, verified datasets of structured 3D shapes from a handful of examples.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for commands in (DATASET_COMMANDS, *_commands_of(packages), SYSTEM_COMMANDS):
        app.add_typer(commands)
    return app


def _commands_of(packages: tuple[str, ...]) -> Iterator[typer.Typer]:
    """The commands of every `commands.py` in the packages and their folders; one with a name is a group."""
    for package in packages:
        modules = [f"{package}.{folder}.commands" for folder in folders_with(package, "commands.py")]
        if find_spec(f"{package}.commands"):
            modules.append(f"{package}.commands")
        for module in modules:
            yield importlib.import_module(module).COMMANDS


def main(package: str = "stages") -> None:
    """Run the command line on the stages of a package, and exit with its code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    show_compilation("shapemill")
    try:
        command_line(package, *(["eval"] if package == "stages" else []))(obj=package, prog_name="shapemill")
    except ModuleNotFoundError as error:
        missing = missing_group(error)
        if missing is None:
            raise
        print(missing, file=sys.stderr)
        sys.exit(2)
    except ConfigError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except Fatal as error:
        print(f"stopped: {error}\nfinished shards are kept; run again to go on", file=sys.stderr)
        sys.exit(3)
