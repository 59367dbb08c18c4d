"""Shared by commands: options, panels of `shapemill --help`, and loading the dataset of `--config` and `--out`.

A room adds commands by a file `commands.py` with `COMMANDS = typer.Typer()`: each `@COMMANDS.command()` becomes a
command of `shapemill`, and a Typer with a name becomes a group. Heavy imports belong inside its functions.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from pipeline.config import Config, load_config
from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from pipeline.remote_output import store_url
from pipeline.stage import Stage

DATASETS = "Make a dataset"
INSPECTION = "Look at a dataset, a mesh or a program"
MODELS = "Train models and use them"
EVALUATION = "Measure"
SYSTEM = "Machine and project"

DEFAULT_CONFIG = Path("configs/default.yaml")
DEFAULT_OUT = Path("datasets")
DEFAULT_WORKERS = os.cpu_count() or 1


def _local_folder(out: Path) -> Path:
    """Return an output folder. Raises ConfigError for a URL."""
    url = store_url(out)
    if url:
        raise ConfigError(
            f"OUT={url}: only `make dataset` and its stages write to a store; name the local folder of their records, "
            f"{DEFAULT_OUT} unless WORK named another"
        )
    return out


ConfigOption = Annotated[Path, typer.Option("--config", help="config of the dataset, a YAML file")]
OutOption = Annotated[Path, typer.Option("--out", callback=_local_folder, help="folder that datasets are written to")]
RunOutOption = Annotated[
    Path, typer.Option("--out", help="folder that datasets are written to, or a URL such as s3://bucket/prefix")
]
WorkOption = Annotated[
    Path, typer.Option("--work", callback=_local_folder, help="folder of records and shards where --out is a URL")
]
WorkersOption = Annotated[int, typer.Option("--workers", min=1, help="number of worker processes")]
SeedOption = Annotated[int | None, typer.Option("--seed", min=0, help="seed in place of the config's")]
OnlyOption = Annotated[str, typer.Option("--only", help="only the shards named so or so-..., and those they read")]
StallOption = Annotated[
    float, typer.Option("--stall-timeout", min=0, help="minutes without progress after which a shard fails; 0: never")
]
ClusterOption = Annotated[str, typer.Option("--cluster", help="scheduler whose workers make the shards: tcp://...")]


def load_dataset(
    context: typer.Context, config: Path, out: Path, seed: int | None = None
) -> tuple[dict[str, Stage], Config, DatasetPaths]:
    """Return the stages, the dataset's config, checked by every stage, and its folders. Raises ConfigError."""
    if out.is_file():
        raise ConfigError(f"{out} is a file; name a folder to write datasets to with --out or OUT")
    stages = find_stages(context.obj)
    overrides = {} if seed is None else {"seed": seed}
    loaded = load_config(config, {name: stage.config for name, stage in stages.items()}, overrides)
    for stage in stages.values():
        stage.check(loaded)
    return stages, loaded, DatasetPaths(out, loaded.name)


def run_or_exit(
    names: Iterable[str], stages: Mapping[str, Stage], config: Config, paths: DatasetPaths, workers: int, **options: Any
) -> None:
    """Run stages in order, with `options` for `run_stages`; exit with 1 where a shard failed."""
    from pipeline.run import run_stages
    from pipeline.termination import exit_on_signals

    with exit_on_signals():
        results = run_stages(names, stages, config, paths, workers, **options)
    for name, result in results.items():
        if result.failed:
            print(f"{name}: failed: {', '.join(result.failed)}; remove the cause, then run again", file=sys.stderr)
            raise typer.Exit(1)


def print_corrupted(stages: Mapping[str, Stage], config: Config, paths: DatasetPaths) -> bool:
    """Print a line for each finished file that is not what its record says; return whether there is one."""
    from pipeline.integrity import corrupted_shards

    lines = list(corrupted_shards(config, stages, paths))
    for line in lines:
        print(line)
    return bool(lines)
