"""Stage `training`: models learn from the samples of a dataset, or from a program, round by round.

Its shards are the samples of each kit and model made ready, the rounds of each model, and the finished models. It is no
part of a dataset: `make train`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.programs.program import program_module
from stages.programs.settings import ProgramsConfig
from stages.shape.collection.shards import PRODUCERS, collection_shards, planned_producer
from stages.shapeassembly.settings import ShapeAssemblyConfig
from stages.sketches.settings import SketchesConfig
from stages.strings.settings import StringsConfig
from stages.training.model_config import KitModelConfig
from stages.training.model_folder import MODEL_FILES, publish_model
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.rounds import RoundChain, find_kind, kind_module, model_name, rounds, run_round
from stages.training.settings import AnyModelConfig, TrainingConfig

TRAINING_SPLITS = ("train", "val")
"""The splits that models see."""
BYTES_PER_ROUND = 16_000_000
"""Weights and two moments of a model of about a million parameters, and what a round learns from beside them."""


def plan(plan: Plan) -> list[Shard]:
    """The samples that models learn from; then the rounds of every model as far as they are known, and each model whose
    rounds have ended."""
    shards: dict[str, Shard] = {}
    for entry, subject, seed in _models(plan):
        if isinstance(entry, KitModelConfig):
            data, pools = _kit_shard(plan, entry, entry.kind, subject), []
        else:
            data, *pools = _program_shards(plan, entry, subject)
        shards.setdefault(data.name, data)
        chain = rounds(plan, entry, entry.kind, subject, seed, data.name, pools)
        shards.update((shard.name, shard) for shard in chain.pools)
        shards.update((shard.name, shard) for shard in chain.shards)
        if chain.ended:
            trained = _trained_shard(plan, entry, subject, seed, chain)
            shards[trained.name] = trained
    return list(shards.values())


def run_shard(task: Task) -> Outcome:
    """Samples made ready, one round, or a finished model."""
    if task.shard.params["job"] == "data":
        return find_kind(task.shard.params["kind"]).prepare(task)
    return run_round(task) if task.shard.params["job"] == "round" else publish_model(task)


def report(plan: Plan) -> Sequence[str]:
    """How far each model is."""
    lines = []
    for entry, subject, seed in _models(plan):
        chain = rounds(plan, entry, entry.kind, subject, seed, "")
        if chain.summaries:
            state = "ended" if chain.ended else f"of {entry.max_rounds} at most"
            lines.append(
                f"{model_name(entry, subject, seed)}: {len(chain.summaries)} rounds {state}, "
                f"{chain.summaries[-1]['step']:,} steps; best loss {chain.summaries[chain.best]['loss']:.4g} "
                f"after {chain.summaries[chain.best]['step']:,}"
            )
    return lines


def publish(plan: Plan) -> Mapping[str, str]:
    """The folder of each finished model."""
    folder = f"{plan.config.name}-models"
    names = (model_name(*model) for model in _models(plan))
    finished = (name for name in names if plan.summary("training", f"{name}-trained") is not None)
    return {
        f"{folder}/{name}/{file}": f"{name}-trained.{file}" for name, file in product(finished, sorted(MODEL_FILES))
    }


def check(config: Config) -> None:
    """Raises ConfigError for models of kits that the config has not, and of programs that are not there."""
    kits = [kit.name for kit in config.section(ExemplarsConfig).kits]
    for entry in config.section(TrainingConfig).models:
        where = f"{config.path}: training.models: {entry.name}"
        if isinstance(entry, KitModelConfig):
            known = _categories(config, entry) if entry.learns_from == "programs" else kits
            unknown = [kit for kit in entry.kits if kit not in known]
            if unknown or not known:
                which = f"there is no kit {unknown[0]}" if unknown else "it learns from kits, and there are none"
                raise ConfigError(f"{where}: {which}; kits are {', '.join(known)}")
            continue
        programs = _programs(config, entry)
        if not programs:
            raise ConfigError(f"{where}: it learns from programs, and there are none; set programs.program")
        views = [view.name for view in config.section(SketchesConfig).views]
        unknown = [view for view in entry.views if view not in views]
        if unknown:
            raise ConfigError(f"{where}: there is no view {unknown[0]}; sketches.views are {', '.join(views)}")
        try:
            for program in programs:
                program_module(program)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}") from error


def uses_samples(config: Config, only: str) -> bool:
    """Whether a model called so, or `<name>-<subject>`, learns from samples; where none is, or `only` is empty,
    whether any does."""
    asked = config.section(TrainingConfig).models
    chosen = [each for each in asked if f"{only}-".startswith(f"{each.name}-")]
    return any(isinstance(each, KitModelConfig) for each in chosen or asked)


def estimate_bytes(plan: Plan) -> int:
    """All rounds of all models."""
    return sum(entry.max_rounds * BYTES_PER_ROUND for entry, _, _ in _models(plan))


def trial(config: Config) -> TrainingConfig:
    """No models: a dataset is planned without what learns from it."""
    return config.section(TrainingConfig).model_copy(update={"models": ()})


def _models(plan: Plan) -> Iterator[tuple[AnyModelConfig, str, int]]:
    """Each model of the config: its entry, its kit or program, its seed."""
    for entry in plan.config.section(TrainingConfig).models:
        if isinstance(entry, KitModelConfig):
            subjects: Sequence[str] = entry.kits or _categories(plan.config, entry) or plan.shards("exemplars")
        else:
            subjects = _programs(plan.config, entry)
        for subject, seed in product(subjects, range(entry.seeds)):
            yield entry, subject, seed


def _categories(config: Config, entry: KitModelConfig) -> tuple[str, ...]:
    """The categories of ShapeAssembly programs that a model of such programs learns from by default."""
    if entry.learns_from != "programs":
        return ()
    section = config.section(ShapeAssemblyConfig)
    return tuple(each.name for each in (*section.programs, *section.hierarchies))


def _programs(config: Config, entry: RecoveryModelConfig) -> tuple[str, ...]:
    """The programs that a model learns from, by default that of the dataset."""
    own = config.section(ProgramsConfig).program if not entry.programs else ""
    return entry.programs or ((own,) if own else ())


def _kit_shard(plan: Plan, entry: KitModelConfig, kind: str, kit: str) -> Shard:
    """The samples of a kit made ready, for all models of a kind."""
    params: dict[str, Any] = {
        "job": "data",
        "kind": kind,
        "kit": kit,
        **entry.prepared,
        "longest": plan.config.section(TrainingConfig).max_length,
    }
    if entry.learns_from == "strings":
        stage = "strings"
        found = {name: plan.summary(stage, name) or {} for name in plan.shards(stage)}
        splits = {name: each["split"] for name, each in found.items() if each.get("split") in TRAINING_SPLITS}
    else:
        stage = planned_producer(plan) or ""
        splits = {
            each.name: each.params["split"]
            for each in collection_shards(plan)
            if each.params["split"] in TRAINING_SPLITS
        }
        params["producer"] = stage
        if entry.learns_from == "shapes":
            strings = plan.config.section(StringsConfig)
            params |= {"edges": strings.edges, "strings": strings.strings_per_shape}
    exemplars = () if entry.learns_from == "programs" else (f"exemplars/{kit}",)
    inputs = (*exemplars, *(f"{stage}/{name}" for name in splits))
    return Shard(
        "-".join((kit, kind, *entry.prepared.values())), {**params, "splits": splits}, inputs, (kind_module(kind),)
    )


def _program_shards(plan: Plan, entry: RecoveryModelConfig, program: str) -> list[Shard]:
    """What the models of a program are judged by, and for each round what they learn from."""
    params: dict[str, Any] = {
        "job": "data",
        "kind": entry.kind,
        "program": program,
        "settings": {key: getattr(entry, key) for key in ("input", "points", "views")},
    }
    if entry.input == "sketch":
        params["sketches"] = plan.config.section(SketchesConfig).model_dump(mode="json")
    name, code = model_name(entry, program, 0).removesuffix("0"), (kind_module(entry.kind), program_module(program))
    judged = {**params, "split": "val", "shapes": entry.validation_shapes}
    learnt = {**params, "split": "train", "shapes": entry.shapes_per_round}
    pools = (Shard(f"{name}pool{number:04}", learnt, (), code) for number in range(entry.max_rounds))
    return [Shard(f"{name}data", judged, (), code), *pools]


def _trained_shard(plan: Plan, entry: AnyModelConfig, subject: str, seed: int, chain: RoundChain) -> Shard:
    name = model_name(entry, subject, seed)
    names = [shard.name for shard in chain.shards]
    params = {
        "job": "trained",
        "name": name,
        "kind": entry.kind,
        entry.subject: subject,
        "dataset": f"{plan.config.name} {plan.config.version}",
        "license": plan.config.license,
        "rounds": names,
        "best": chain.best,
    }
    return Shard(f"{name}-trained", params, tuple(f"training/{each}" for each in names))


STAGE = Stage(
    name="training",
    module=__name__,
    config=TrainingConfig,
    inputs=("exemplars", "strings", PRODUCERS),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    publish=publish,
    check=check,
    sections=("programs", "sketches"),
    trial_config=trial,
    whole_section=False,
    publishes_incomplete=True,
    uses_input=uses_samples,
)
