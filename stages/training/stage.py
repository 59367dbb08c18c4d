"""Stage `training`: models learn from the samples of a dataset, or from a program, round by round.

Its shards are the prepared samples of each kit and kind, the rounds of each model, and the finished models. The stage
is no part of a dataset: `make train`.
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
from stages.shape.collection.discovery import language_of, producers
from stages.shape.collection.shards import PRODUCERS, collection_shards, planned_producer
from stages.shapeassembly.settings import ShapeAssemblyConfig
from stages.sketches.settings import SketchesConfig
from stages.strings.settings import StringsConfig
from stages.training.kind import find_kind, kind_module
from stages.training.model_config import KitModelConfig
from stages.training.model_folder import MODEL_FILES, publish_model
from stages.training.point_encoder.settings import PointEncoderConfig
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.rounds import RoundChain, model_name, round_chain, run_round
from stages.training.settings import AnyModelConfig, TrainingConfig

TRAINING_SPLITS = ("train", "val")
BYTES_PER_ROUND = 16_000_000
"""Weights and two moments of a model of about a million parameters, and its samples."""


def plan(plan: Plan) -> list[Shard]:
    """Plan the prepared samples, the rounds as far as they are known, and each model whose rounds have ended."""
    shards: dict[str, Shard] = {}
    for model, subject, seed in _models(plan):
        if isinstance(model, KitModelConfig):
            data, pools = _kit_shard(plan, model, model.kind, subject), list[Shard]()
        elif isinstance(model, PointEncoderConfig):
            data, pools = _collection_shard(plan, model, subject), []
        else:
            data, *pools = _program_shards(plan, model, subject)
        shards.setdefault(data.name, data)
        chain = round_chain(plan, model, model.kind, subject, seed, data.name, pools)
        shards.update((shard.name, shard) for shard in chain.pools)
        shards.update((shard.name, shard) for shard in chain.shards)
        if chain.ended:
            trained = _trained_shard(plan, model, subject, seed, chain)
            shards[trained.name] = trained
    return list(shards.values())


def run_shard(task: Task) -> Outcome:
    """Prepare samples, train one round, or publish a finished model."""
    if task.shard.params["job"] == "data":
        return find_kind(task.shard.params["kind"]).prepare(task)
    return run_round(task) if task.shard.params["job"] == "round" else publish_model(task)


def report(plan: Plan) -> Sequence[str]:
    """Report the progress of each model."""
    lines = []
    for model, subject, seed in _models(plan):
        chain = round_chain(plan, model, model.kind, subject, seed, "")
        if chain.summaries:
            state = "ended" if chain.ended else f"of {model.max_rounds} at most"
            lines.append(
                f"{model_name(model, subject, seed)}: {len(chain.summaries)} rounds {state}, "
                f"{chain.summaries[-1]['step']:,} steps; best loss {chain.summaries[chain.best]['loss']:.4g} "
                f"after {chain.summaries[chain.best]['step']:,}"
            )
    return lines


def publish(plan: Plan) -> Mapping[str, str]:
    """Return the files of each finished model."""
    folder = f"{plan.config.name}-models"
    names = (model_name(*model) for model in _models(plan))
    finished = (name for name in names if plan.summary("training", f"{name}-trained") is not None)
    return {
        f"{folder}/{name}/{file}": f"{name}-trained.{file}" for name, file in product(finished, sorted(MODEL_FILES))
    }


def check(config: Config) -> None:
    """Raise ConfigError for models of unknown kits, programs or views."""
    kits = [kit.name for kit in config.section(ExemplarsConfig).kits]
    for model in config.section(TrainingConfig).models:
        where = f"{config.path}: training.models: {model.name}"
        if isinstance(model, KitModelConfig):
            if model.learns_from == "strings" and not config.section(StringsConfig).enabled:
                raise ConfigError(f"{where}: it learns from strings, which are turned off; remove strings: false")
            known = _categories(config, model) if model.learns_from == "programs" else kits
            unknown = [kit for kit in model.kits if kit not in known]
            if unknown or not known:
                which = f"there is no kit {unknown[0]}" if unknown else "the config has no kits"
                raise ConfigError(f"{where}: {which}; kits are {', '.join(known)}")
            if model.learns_from == "strings" and not _has_strings(config):
                raise ConfigError(
                    f"{where}: it learns from strings, and no shape of this config has one: shapes in other "
                    "proportions have no strings; set variations.samples_per_kit, or train another kind of model"
                )
            continue
        if isinstance(model, PointEncoderConfig):
            continue
        programs = _programs(config, model)
        if not programs:
            raise ConfigError(f"{where}: it learns from programs, but the config has no program; set programs.program")
        views = [view.name for view in config.section(SketchesConfig).views]
        unknown = [view for view in model.views if view not in views]
        if unknown:
            raise ConfigError(f"{where}: there is no view {unknown[0]}; sketches.views are {', '.join(views)}")
        try:
            for program in programs:
                program_module(program)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}") from error


def _has_strings(config: Config) -> bool:
    """Return whether a producer that the config requests makes shapes with strings."""
    makers = [name for name, producer in producers().items() if not producer.joins and producer.is_requested(config)]
    return any(language_of(name).graphs for name in makers)


def uses_samples(config: Config, only: str) -> bool:
    """Return whether the models that `only` selects, a name or `<name>-<subject>`, learn from samples.

    Where it selects none, all models count.
    """
    models = config.section(TrainingConfig).models
    selected = [model for model in models if f"{only}-".startswith(f"{model.name}-")]
    return any(model.subject != "program" for model in selected or models)


def estimate_bytes(plan: Plan) -> int:
    """Estimate the bytes of all rounds of all models."""
    return sum(model.max_rounds * BYTES_PER_ROUND for model, _, _ in _models(plan))


def trial(config: Config) -> TrainingConfig:
    """Return the config without models."""
    return config.section(TrainingConfig).model_copy(update={"models": ()})


def _models(plan: Plan) -> Iterator[tuple[AnyModelConfig, str, int]]:
    """Yield each model of the config: its config, its kit, program or dataset, its seed."""
    for model in plan.config.section(TrainingConfig).models:
        if isinstance(model, KitModelConfig):
            subjects: Sequence[str] = model.kits or _categories(plan.config, model) or plan.shards("exemplars")
        elif isinstance(model, PointEncoderConfig):
            subjects = (plan.config.name,)
        else:
            subjects = _programs(plan.config, model)
        for subject, seed in product(subjects, range(model.seeds)):
            yield model, subject, seed


def _categories(config: Config, model: KitModelConfig) -> tuple[str, ...]:
    """Return the categories of ShapeAssembly programs that a model learns from by default."""
    if model.learns_from != "programs":
        return ()
    section = config.section(ShapeAssemblyConfig)
    return tuple(files.name for files in (*section.programs, *section.hierarchies))


def _programs(config: Config, model: RecoveryModelConfig) -> tuple[str, ...]:
    """Return the programs that a model learns from, by default those of the dataset."""
    return model.programs or tuple(entry.program for entry in config.section(ProgramsConfig).sampled)


def _kit_shard(plan: Plan, model: KitModelConfig, kind: str, kit: str) -> Shard:
    """Plan the prepared samples of a kit, for all models of a kind."""
    params: dict[str, Any] = {
        "job": "data",
        "kind": kind,
        "kit": kit,
        **model.prepared,
        "max_length": plan.config.section(TrainingConfig).max_length,
    }
    if model.learns_from == "strings":
        stage = "strings"
        summaries = {name: plan.summary(stage, name) or {} for name in plan.shards(stage)}
        splits = {
            name: summary["split"] for name, summary in summaries.items() if summary.get("split") in TRAINING_SPLITS
        }
    else:
        stage = planned_producer(plan) or ""
        splits = {
            shard.name: shard.params["split"]
            for shard in collection_shards(plan)
            if shard.params["split"] in TRAINING_SPLITS
        }
        params["producer"] = stage
        if model.learns_from == "shapes":
            strings = plan.config.section(StringsConfig)
            params |= {"edges": strings.edges, "strings": strings.strings_per_shape}
    exemplars = () if model.learns_from == "programs" else (f"exemplars/{kit}",)
    inputs = (*exemplars, *(f"{stage}/{name}" for name in splits))
    return Shard(
        "-".join((kit, kind, *model.prepared.values())), {**params, "splits": splits}, inputs, (kind_module(kind),)
    )


def _collection_shard(plan: Plan, model: PointEncoderConfig, name: str) -> Shard:
    """Plan the prepared clouds of a dataset, for all encoders of at most as many shapes."""
    shards = [shard for shard in collection_shards(plan) if shard.params["split"] in TRAINING_SPLITS]
    common = shards[0].params if shards else {}
    params: dict[str, Any] = {
        **{key: common[key] for key in ("producer", "joined") if key in common},
        "job": "data",
        "kind": model.kind,
        "collection": name,
        "max_shapes": model.max_shapes,
        "splits": {shard.name: shard.params["split"] for shard in shards},
        "samples_of": {shard.name: shard.params["samples"] for shard in shards},
    }
    inputs = dict.fromkeys(read for shard in shards for read in shard.inputs)
    return Shard(f"{name}-{model.kind}-{model.max_shapes}", params, tuple(inputs), (kind_module(model.kind),))


def _program_shards(plan: Plan, model: RecoveryModelConfig, program: str) -> list[Shard]:
    """Plan the validation samples of a program, and the training samples of each round."""
    params: dict[str, Any] = {
        "job": "data",
        "kind": model.kind,
        "program": program,
        "settings": {key: getattr(model, key) for key in ("input", "points", "views")},
    }
    if model.input == "sketch":
        params["sketches"] = plan.config.section(SketchesConfig).model_dump(mode="json")
    name, code = model_name(model, program, 0).removesuffix("0"), (kind_module(model.kind), program_module(program))
    validation = {**params, "split": "val", "shapes": model.validation_shapes}
    training = {**params, "split": "train", "shapes": model.shapes_per_round}
    pools = (Shard(f"{name}pool{number:04}", training, (), code) for number in range(model.max_rounds))
    return [Shard(f"{name}data", validation, (), code), *pools]


def _trained_shard(plan: Plan, model: AnyModelConfig, subject: str, seed: int, chain: RoundChain) -> Shard:
    name = model_name(model, subject, seed)
    names = [shard.name for shard in chain.shards]
    params = {
        "job": "trained",
        "name": name,
        "kind": model.kind,
        model.subject: subject,
        "dataset": f"{plan.config.name} {plan.config.version}",
        "license": plan.config.license,
        "rounds": names,
        "best": chain.best,
    }
    return Shard(f"{name}-trained", params, tuple(f"training/{name}" for name in names))


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
