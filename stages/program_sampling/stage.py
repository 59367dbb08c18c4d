"""Stage `program_sampling`: ShapeAssembly programs from trained models, which stage `shapeassembly` reads.

A shard is some of the programs of one model, `.jsonl`, one a line: category, name and text.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipeline.config import Config
from pipeline.errors import ConfigError, Rejected, ShardFailed
from pipeline.package_groups import require_group
from pipeline.paths import file_digest
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.program_sampling.settings import ProgramSamplingConfig
from stages.shapeassembly.settings import SampledPrograms, ShapeAssemblyConfig
from stages.shapeassembly.syntax.printer import print_program

BYTES_PER_PROGRAM = 3_000


def plan(plan: Plan) -> list[Shard]:
    """Plan the shards of every model, in the order of the config. Raises ConfigError for a missing model."""
    max_programs = plan.config.section(ProgramSamplingConfig).programs_per_shard
    shards: list[Shard] = []
    for source in plan.config.section(ShapeAssemblyConfig).sampled:
        digest = file_digest(_weights(plan, source))
        for first in range(0, source.samples, max_programs):
            params = {
                "kind": source.name,
                "folder": source.folder,
                "digest": digest,
                "kit": source.kit,
                "temperature": source.temperature,
                "top_p": source.top_p,
                "first": first,
                "samples": min(max_programs, source.samples - first),
            }
            shards.append(Shard(f"{plan.config.name}-sampled-{len(shards):06d}", params))
    return shards


def _weights(plan: Plan, source: SampledPrograms) -> Path:
    path = plan.published(f"{source.folder}/weights.safetensors")
    if not path.is_file():
        raise ConfigError(
            f"{plan.config.path}: shapeassembly.sampled[{source.name}]: there is no {path}; make train with the config "
            f"of {source.dataset} and MODEL={source.model} first"
        )
    return path


def run_shard(task: Task) -> Outcome:
    """Sample programs; those given up by the model are rejected.

    Raises Rejected for weights of another kind or kit, and for a model that gives up nearly all programs; ShardFailed
    for weights that have changed since the run began.
    """
    from stages.training.checkpoint import CheckpointError
    from stages.training.load import load_program_sampler

    params = task.shard.params
    path = task.published(f"{params['folder']}/weights.safetensors")
    if file_digest(path) != params["digest"]:
        raise ShardFailed(f"{path} has changed since the run began")
    try:
        model = load_program_sampler(path, {"kit": params["kit"]}, params["top_p"])
        programs, started = model.sample(params["samples"], task.rng("points"), params["temperature"])
    except (CheckpointError, ValueError) as error:
        raise Rejected(f"{path}: {error}") from error
    if started > len(programs):
        task.reject(params["folder"], "given up while it was sampled", count=started - len(programs))
    with task.output(f"{task.shard.name}.jsonl") as stream:
        for number, program in enumerate(programs, params["first"]):
            name = f"{params['folder']}/{number:06d}"
            stream.write(json_bytes({"kit": params["kind"], "name": name, "text": print_program(program)}))
    return Outcome(0, {"programs": len(programs), "started": started})


def report(plan: Plan) -> Sequence[str]:
    """Report how many programs each model started for those that it completed."""
    lines = []
    for source in plan.config.section(ShapeAssemblyConfig).sampled:
        summaries = [
            plan.summary("program_sampling", shard.name)
            for shard in STAGE.plan(plan)
            if shard.params["kind"] == source.name
        ]
        done = [summary for summary in summaries if summary is not None]
        if done:
            programs, started = (sum(summary[name] for summary in done) for name in ("programs", "started"))
            lines.append(f"{source.folder}: {programs:,} programs of {started:,} started")
    return lines


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all programs."""
    return BYTES_PER_PROGRAM * sum(source.samples for source in plan.config.section(ShapeAssemblyConfig).sampled)


def check_environment(config: Config) -> None:
    """Raise ConfigError where the config names trained models and torch is not installed."""
    if config.section(ShapeAssemblyConfig).sampled:
        require_group("models")


def trial(config: Config) -> ProgramSamplingConfig:
    """Return the same config: the trial of stage `shapeassembly` has few programs."""
    return config.section(ProgramSamplingConfig)


STAGE = Stage(
    name="program_sampling",
    module=__name__,
    config=ProgramSamplingConfig,
    inputs=(),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    sections=("shapeassembly",),
    check_environment=check_environment,
    trial_config=trial,
)
