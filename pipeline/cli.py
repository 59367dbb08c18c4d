"""The command line: `python -m pipeline run|plan|status|verify|inspect|doctor|cluster|keys|clean`.

Exit codes: 0 all is well; 1 shards were set aside, or something that was checked is not as it should be; 2 nothing
started, because of a mistake in the config or the command; 3 everything had to stop (disk full, no permission);
130 stopped by Ctrl-C; 143 by SIGTERM, 129 by SIGHUP.
"""

from __future__ import annotations

import importlib
import os
import re
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import typer

from pipeline.config import Config, load_config, nearest_word
from pipeline.errors import ConfigError, Fatal
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from pipeline.stage import Stage
from pipeline.stall_timeout import DEFAULT_STALL_MINUTES
from pipeline.termination import exit_on_signals

app = typer.Typer(
    name="pipeline",
    help="The mill of Shapemill.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

_PASS_ON = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}

DEFAULT_CONFIG = Path("configs/default.yaml")
DEFAULT_OUT = Path("datasets")
DEFAULT_WORKERS = os.cpu_count() or 1

ConfigOption = Annotated[Path, typer.Option("--config", help="the dataset's YAML")]
OutOption = Annotated[Path, typer.Option("--out", help="folder that datasets are made in")]
WorkersOption = Annotated[int, typer.Option("--workers", min=1, help="worker processes")]
SeedOption = Annotated[int | None, typer.Option("--seed", min=0, help="instead of the config's seed")]


@app.command()
def run(
    context: typer.Context,
    stage: Annotated[str, typer.Argument(help="the stage to run")],
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
    seed: SeedOption = None,
    shards: Annotated[str, typer.Option(help="make part i of n, from 1, as one job of a job array: i/n")] = "1/1",
    retries: Annotated[int, typer.Option(min=0, help="how often a shard that failed is tried again")] = 2,
    only: Annotated[str, typer.Option(help="make the shards called so, or so-..., and what they read")] = "",
    patience: Annotated[
        float, typer.Option(min=0, help="minutes without progress after which a shard has failed; 0: never")
    ] = DEFAULT_STALL_MINUTES,
    cluster: Annotated[str, typer.Option(help="scheduler of a cluster whose workers make the shards: tcp://...")] = "",
) -> None:
    """Make what is missing of one stage."""
    from pipeline.run import run_stage
    from pipeline.slices import Slice

    part = Slice(*_slice(shards))
    stages = find_stages(context.obj)
    if stage not in stages:
        close = nearest_word(stage, stages)
        hint = f"did you mean {close}?" if close else f"stages are {', '.join(stages)}"
        raise ConfigError(f"there is no stage {stage}; {hint}")
    with exit_on_signals():
        loaded, places = _load(stages, config, out, seed)
        result = run_stage(
            *(stage, stages, loaded, places, workers, part, retries), only=only, patience=patience, cluster=cluster
        )
    if result.failed:
        print(
            f"{stage}: set aside: {', '.join(result.failed)}; run again once what was said of them is mended",
            file=sys.stderr,
        )
        raise typer.Exit(1)


@app.command()
def plan(
    context: typer.Context,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
    seed: SeedOption = None,
) -> None:
    """Show what the whole dataset will take: shards, samples, disk and time, from a short trial where need be."""
    from pipeline.estimate import plan_lines

    stages = find_stages(context.obj)
    loaded, places = _load(stages, config, out, seed)
    for line in plan_lines(loaded, stages, places, workers):
        print(line, flush=True)


@app.command()
def status(
    context: typer.Context,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
    seed: SeedOption = None,
) -> None:
    """Show for each stage what is done, failed, rejected and left, from the records."""
    from pipeline.status import status_lines

    stages = find_stages(context.obj)
    loaded, places = _load(stages, config, out, seed)
    for line in status_lines(loaded, stages, places, workers):
        print(line)


@app.command(context_settings=_PASS_ON)
def verify(
    context: typer.Context,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = None,
    workers: WorkersOption = 1,
) -> None:
    """Check every byte against the records, then the finished dataset from its meshes."""
    from pipeline.integrity import corrupted_shards

    stages = find_stages(context.obj)
    loaded, places = _load(stages, config, out, seed)
    damages = list(corrupted_shards(loaded, stages, places))
    for line in damages:
        print(line)
    arguments = ["--config", str(config), "--out", str(out), "--workers", str(workers), *context.args]
    if seed is not None:
        arguments += ["--seed", str(seed)]
    code = _entry(context, "package.verify")(arguments)
    raise typer.Exit(code or int(bool(damages)))


@app.command(context_settings=_PASS_ON)
def inspect(context: typer.Context) -> None:
    """Show what Shapemill sees in some meshes and what it can make of them, and write a config for it."""
    raise typer.Exit(_entry(context, "inspection.inspect")(context.args))


@app.command()
def doctor(out: OutOption = DEFAULT_OUT) -> None:
    """Try everything that Shapemill needs on this machine, and say how to mend what fails."""
    from pipeline.doctor import examine

    raise typer.Exit(examine(out))


@app.command()
def cluster(
    workers: WorkersOption = DEFAULT_WORKERS,
    port: Annotated[
        int, typer.Option(min=1, max=65535, help="where the scheduler listens, on this machine alone")
    ] = 8786,
) -> None:
    """Start a scheduler and workers of a cluster on this machine, for runs with --cluster; Ctrl-C ends them."""
    from pipeline.local_cluster import serve_cluster

    raise typer.Exit(serve_cluster(workers, port))


@app.command()
def keys(context: typer.Context) -> None:
    """Print the table of all config keys as Markdown."""
    from pipeline.config_docs import config_tables

    print(config_tables(find_stages(context.obj)), end="")


@app.command()
def clean(context: typer.Context, config: ConfigOption = DEFAULT_CONFIG, out: OutOption = DEFAULT_OUT) -> None:
    """Remove the work folder of a dataset: records and shards, not the finished dataset."""
    _, places = _load(find_stages(context.obj), config, out, None)
    work = places.work
    if work.is_dir():
        shutil.rmtree(work)
    print(f"removed {work}")


def _slice(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    index, count = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= index <= count:
        raise ConfigError(f"--shards {text}: must be i/n with 1 <= i <= n, such as 2/8")
    return index, count


def _load(stages: Mapping[str, Stage], config: Path, out: Path, seed: int | None) -> tuple[Config, DatasetPaths]:
    """The dataset's config, which every stage has checked, and its folders."""
    overrides = {} if seed is None else {"seed": seed}
    loaded = load_config(config, {name: stage.config for name, stage in stages.items()}, overrides)
    for stage in stages.values():
        stage.check(loaded)
    return loaded, DatasetPaths(out, loaded.name)


def _entry(context: typer.Context, module: str) -> Callable[[list[str]], int]:
    # By name: the mill imports no stage, and finds this as it finds their STAGE.
    entry: Callable[[list[str]], int] = importlib.import_module(f"{context.obj}.{module}").main
    return entry


def main(package: str = "stages") -> None:
    """Run the command line on the stages of a package, and exit with its code."""
    try:
        app(obj=package)
    except ConfigError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except Fatal as error:
        print(f"stopped: {error}\nwhat is done is kept; run again to go on", file=sys.stderr)
        sys.exit(3)
