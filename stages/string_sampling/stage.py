"""Stage `string_sampling`: from trained string models to generated shapes, `<dataset>-<split>-<index>.tar`.

Its shards are the models, the search workers and pools of each model's rounds, the assignment of shapes to splits, and
the collection.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.package_groups import require_group
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.string_sampling.collection import assignment_shard, planned_collection, run_assignment, run_collection
from stages.string_sampling.rounds import model_rounds, run_pool
from stages.string_sampling.settings import StringSamplingConfig
from stages.string_sampling.source import run_source
from stages.string_sampling.worker import run_worker
from stages.variations.settings import VariationsConfig

BYTES_PER_SAMPLE = 40_000
BYTES_PER_MODEL = 8_000_000

_JOBS = {
    "source": run_source,
    "worker": run_worker,
    "pool": run_pool,
    "assignment": run_assignment,
    "collection": run_collection,
}


def plan(plan: Plan) -> list[Shard]:
    """Plan the rounds of every model as far as they are known, then the assignment and the collection."""
    sources = plan.config.section(StringSamplingConfig).sources
    models = [model_rounds(plan, number, source) for number, source in enumerate(sources)]
    shards = [shard for model in models for shard in model.shards]
    if not models or not all(model.ended for model in models):
        return shards
    assignment = assignment_shard(plan, models)
    return [*shards, assignment, *planned_collection(plan, assignment)]


def run_shard(task: Task) -> Outcome:
    """Make one shard of the plan."""
    return _JOBS[task.shard.params["job"]](task)


def report(plan: Plan) -> Sequence[str]:
    """Report the progress of each model, and the reasons of rejected draws."""
    config = plan.config.section(StringSamplingConfig)
    lines = []
    for number, source in enumerate(config.sources):
        model = model_rounds(plan, number, source)
        if model.pools:
            rejected: Counter[str] = Counter()
            for worker in model.workers:
                rejected.update(plan.rejects("string_sampling", worker))
            found = sum(pool["new"] for pool in model.pools)
            drawn = len(model.pools) * config.parallel_searches * config.draws
            why = ", ".join(f"{count:,} {reason}" for reason, count in rejected.most_common())
            ended = f"; {model.ended}" if model.ended else ""
            lines.append(
                f"{source.dataset}/{source.model}-{source.kit}-{source.seed}: {found:,} shapes for {source.samples:,} "
                f"of {drawn:,} draws{ended}; rejected: {why or 'none'}"
            )
    return lines


def check(config: Config) -> None:
    """Raise ConfigError for models of unknown kits, and for variations in the same dataset."""
    sources = config.section(StringSamplingConfig).sources
    kits = [kit.name for kit in config.section(ExemplarsConfig).kits]
    for number, source in enumerate(sources):
        if source.kit not in kits:
            raise ConfigError(
                f"{config.path}: string_sampling.sources.{number}: there is no kit"
                f" {source.kit}; kits are {', '.join(kits)}"
            )
    if sources and config.section(VariationsConfig).samples_per_kit:
        raise ConfigError(
            f"{config.path}: string_sampling.sources asks for"
            f" generated shapes, and variations.samples_per_kit for variations of the "
            "same kits: a dataset is made in one way; set variations.samples_per_kit: 0"
        )


def requested_samples(config: Config) -> Sequence[int]:
    """Return the shapes of each shard, if every model finds enough."""
    section = config.section(StringSamplingConfig)
    return section.splits.shard_sizes(sum(source.samples for source in section.sources))


def check_environment(config: Config) -> None:
    """Raise ConfigError where the config names trained models and torch is not installed."""
    if config.section(StringSamplingConfig).sources:
        require_group("models")


def trial(config: Config) -> StringSamplingConfig:
    """Return a config with a few shapes of each model."""
    section = config.section(StringSamplingConfig)
    few = max(32 // max(len(section.sources), 1), 4)
    sources = tuple(source.model_copy(update={"samples": few}) for source in section.sources)
    update = {"sources": sources, "splits": section.splits.for_trial(), "parallel_searches": 1, "draws": 2 * few}
    return section.model_copy(update=update)


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all models, and of each shape by its worker and in the collection."""
    sources = plan.config.section(StringSamplingConfig).sources
    return len(sources) * BYTES_PER_MODEL + 2 * BYTES_PER_SAMPLE * sum(source.samples for source in sources)


STAGE = Stage(
    name="string_sampling",
    module=__name__,
    config=StringSamplingConfig,
    inputs=("exemplars",),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    check=check,
    requested_samples=requested_samples,
    check_environment=check_environment,
    trial_config=trial,
    whole_section=False,
)
