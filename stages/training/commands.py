"""Commands of this room; see `pipeline/options.py`."""

from __future__ import annotations

import typer

from pipeline.options import (
    DEFAULT_CONFIG,
    DEFAULT_OUT,
    DEFAULT_WORKERS,
    MODELS,
    ClusterOption,
    ConfigOption,
    OnlyOption,
    OutOption,
    SeedOption,
    StallOption,
    WorkersOption,
    load_dataset,
    run_or_exit,
)
from pipeline.stall_timeout import DEFAULT_STALL_MINUTES

COMMANDS = typer.Typer()


@COMMANDS.command(rich_help_panel=MODELS)
def train(
    context: typer.Context,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    workers: WorkersOption = DEFAULT_WORKERS,
    seed: SeedOption = None,
    only: OnlyOption = "",
    stall_timeout: StallOption = DEFAULT_STALL_MINUTES,
    cluster: ClusterOption = "",
) -> None:
    """Train the models of a config, after making the samples that they learn from."""
    from pipeline.errors import ConfigError
    from pipeline.package_groups import require_group
    from pipeline.registry import upstream
    from stages.training.settings import TrainingConfig

    require_group("models")
    stages, loaded, paths = load_dataset(context, config, out, seed)
    if not loaded.section(TrainingConfig).models:
        raise ConfigError(f"{config}: has no training.models to train; stages/training/README.md has an example")
    if stages["training"].uses_input(loaded, only):
        samples = [name for name in upstream(stages, "training") if name != "training"]
        run_or_exit(samples, stages, loaded, paths, workers, stall_minutes=stall_timeout, cluster=cluster)
    run_or_exit(["training"], stages, loaded, paths, workers, only=only, stall_minutes=stall_timeout, cluster=cluster)
