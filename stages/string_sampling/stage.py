"""Stage `string_sampling`: shapes that they dreamt out, as the shards `<dataset>-<split>-<index>.tar`.

Its shards are the models brought in, the lanes and pools of each model's rounds, the assignment of shapes to splits,
and the collection.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.string_sampling.collection import assignment_shard, planned_collection, run_assignment, run_collection
from stages.string_sampling.rounds import model_rounds, run_pool
from stages.string_sampling.settings import StringSamplingConfig
from stages.string_sampling.source import run_source
from stages.string_sampling.worker import run_worker
from stages.variations.settings import VariationsConfig

BYTES_A_SAMPLE = 40_000
BYTES_A_MODEL = 8_000_000

_JOBS = {
    "source": run_source,
    "lane": run_worker,
    "pool": run_pool,
    "assignment": run_assignment,
    "collection": run_collection,
}


def plan(plan: Plan) -> list[Shard]:
    """The rounds of every model as far as they are known, then the assignment and the collection."""
    sources = plan.config.section(StringSamplingConfig).sources
    models = [model_rounds(plan, number, source) for number, source in enumerate(sources)]
    shards = [shard for each in models for shard in each.shards]
    if not models or not all(each.ended for each in models):
        return shards
    assignment = assignment_shard(plan, models)
    return [*shards, assignment, *planned_collection(plan, assignment)]


def run_shard(task: Task) -> Outcome:
    """One shard of the plan."""
    return _JOBS[task.shard.params["job"]](task)


def report(plan: Plan) -> Sequence[str]:
    """How far each model is, and what became of what it drew."""
    config = plan.config.section(StringSamplingConfig)
    lines = []
    for number, source in enumerate(config.sources):
        model = model_rounds(plan, number, source)
        if model.pools:
            refused: Counter[str] = Counter()
            for lane in model.lanes:
                refused.update(plan.rejects("string_sampling", lane))
            found = sum(each["new"] for each in model.pools)
            drawn = len(model.pools) * config.lanes * config.draws
            why = ", ".join(f"{count:,} {reason}" for reason, count in refused.most_common())
            ended = f"; {model.ended}" if model.ended else ""
            lines.append(
                f"{source.dataset}/{source.model}-{source.kit}-{source.seed}: {found:,} shapes for {source.samples:,} "
                f"of {drawn:,} draws{ended}; refused: {why or 'none'}"
            )
    return lines


def check(config: Config) -> None:
    """Raises ConfigError for models of kits that the config has not, and for variations beside them."""
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
            f" dreamt shapes, and variations.samples_per_kit for variations of the "
            "same kits: a dataset is made in one way; set variations.samples_per_kit: 0"
        )


def asked(config: Config) -> Sequence[int]:
    """The shapes of each shard, if every model finds as many as are wanted."""
    section = config.section(StringSamplingConfig)
    return section.splits.shard_sizes(sum(source.samples for source in section.sources))


def trial(config: Config) -> StringSamplingConfig:
    """A few shapes of each model."""
    section = config.section(StringSamplingConfig)
    few = max(32 // max(len(section.sources), 1), 4)
    sources = tuple(source.model_copy(update={"samples": few}) for source in section.sources)
    update = {"sources": sources, "splits": section.splits.for_trial(), "lanes": 1, "draws": 2 * few}
    return section.model_copy(update=update)


def estimate_bytes(plan: Plan) -> int:
    """All models, and each shape in its lane and in the collection."""
    sources = plan.config.section(StringSamplingConfig).sources
    return len(sources) * BYTES_A_MODEL + 2 * BYTES_A_SAMPLE * sum(source.samples for source in sources)


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
    requested_samples=asked,
    trial_config=trial,
    whole_section=False,
)
