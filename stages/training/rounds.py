"""The rounds of a training: a chain of shards, each of which reads the one before it."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, cast, get_args

from pipeline.code import code_digest, transitive_imports
from pipeline.errors import ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.programs.program import program_module
from stages.training.model_config import ModelConfig, Subject


class Kind(Protocol):
    """What the `training.py` of a kind holds; its folder is found by the kind's name."""

    def prepare(self, task: Task) -> Outcome:
        """Make samples of a kit or a program ready, as files `<shard>.<anything>`."""

    def entry(self, settings: Mapping[str, Any]) -> ModelConfig:
        """The entry whose JSON is `settings`."""

    def learner(self, task: Task, entry: Any, seed: int) -> Any:
        """A `Learner` with fresh weights, of `task.shard.params`: `kit` or `program`, and `data`, the shard that
        `prepare` made."""


def kind_module(kind: str) -> str:
    """The module of a kind."""
    return f"{__name__.rpartition('.')[0]}.{kind}.training"


def find_kind(kind: str) -> Kind:
    """The kind of models of that name."""
    return cast(Kind, importlib.import_module(kind_module(kind)))


@dataclass(frozen=True)
class RoundChain:
    """The rounds of one model as far as they are known.

    pools: what is to be made for them so far, one round ahead, so that other workers make what the next round learns
    from while one learns; best: the number of the round with the best weights; ended: whether another round is none
    of the plan.
    """

    shards: tuple[Shard, ...]
    pools: tuple[Shard, ...]
    summaries: tuple[Mapping[str, Any], ...]
    best: int
    ended: bool


def model_name(entry: ModelConfig, subject: str, seed: int) -> str:
    """What a model's shards and its folder are called. A program may be a module, whose dots no file name has."""
    return f"{entry.name}-{subject.replace('.', '_')}-{seed}"


def subject_fields(params: Mapping[str, Any]) -> dict[str, Any]:
    """What a shard's model learns from: `{"kit": name}` or `{"program": name}`."""
    return {key: params[key] for key in get_args(Subject) if key in params}


def rounds(
    plan: Plan, entry: ModelConfig, kind: str, subject: str, seed: int, data: str, pools: Sequence[Shard] = ()
) -> RoundChain:
    """The chain of one model: a round follows the one before it, until there are `rounds`, or `patience` of them in a
    row were no better than the best. Where there are `pools`, one for each round, a round reads its own and those of
    the rounds before.

    So a training that ends early has made nothing that says nothing. What decides about the end, and which kits and
    seeds there are besides, is no setting of a round.
    """
    settings = entry.model_dump(mode="json", exclude={"name", "kits", "programs", "seeds", "patience"})
    shards: list[Shard] = []
    summaries: list[Mapping[str, Any]] = []
    best = 0
    for number in range(entry.max_rounds):
        name = f"{model_name(entry, subject, seed)}-r{number:04}"
        before = [shards[-1].name] if shards else []
        params = {
            "job": "round", "kind": kind, entry.subject: subject, "seed": seed, "round": number, "data": data,
            "before": before, "settings": settings,
        }  # fmt: skip
        read = [each.name for each in pools[: number + 1]]
        if read:
            params["pools"] = read
        inputs = tuple(f"training/{each}" for each in (data, *read, *before))
        shards.append(Shard(name, params, inputs, _modules(params), entry.threads))
        summary = plan.summary("training", name)
        if summary is None:
            return RoundChain(tuple(shards), tuple(pools[: number + 2]), tuple(summaries), best, ended=False)
        summaries.append(summary)
        if summary["loss"] < summaries[best]["loss"]:
            best = number
        if number - best >= entry.patience:
            break
    return RoundChain(tuple(shards), tuple(pools[: len(shards) + 1]), tuple(summaries), best, ended=True)


def run_round(task: Task) -> Outcome:
    """Files of the shard: `.safetensors`, weights and moments of the optimiser; `.json`, the figures of the round."""
    from stages.training.checkpoint import checkpoint_bytes, load_checkpoint
    from stages.training.loop import TrainState, resolve_precision, set_deterministic, train

    params, name = task.shard.params, task.shard.name
    kind = find_kind(params["kind"])
    entry = kind.entry({"name": "round", **params["settings"]})
    set_deterministic(entry.threads)
    learner = kind.learner(task, entry, _seed(task, "weights"))
    trainee = TrainState.of(learner, entry)
    described = {"kind": params["kind"], **subject_fields(params), "settings": params["settings"], **learner.header}
    for before in params["before"]:
        tensors, header = load_checkpoint(task.input("training", f"{before}.safetensors"), described)
        trainee.restore(tensors, header["step"])
    learnt = train(trainee, entry, task.rng("batches"), task.progress)
    import torch

    device = next(learner.module.parameters()).device
    precision = resolve_precision(entry.precision, device)
    learner.module.eval()
    with torch.no_grad():
        found = learner.validate(torch.Generator(device).manual_seed(_seed(task, "validation")))
    figures = {"round": params["round"], "step": trainee.step}
    figures |= {f"train_{key}": value for key, value in learnt.items()}
    figures |= {f"val_{key}": value for key, value in found.items()}
    if not _finite(figures.values()):
        raise ShardFailed(f"the training has run away: {json.dumps(figures)}; try a smaller learning_rate")
    header = {
        **described,
        "step": trainee.step,
        "code": code_digest(transitive_imports(_modules(params))),
        "device": device.type,
        "precision": precision,
        "figures": figures,
    }
    with task.output(f"{name}.safetensors") as stream:
        stream.write(checkpoint_bytes(trainee.tensors(), header))
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes(figures))
    return Outcome(samples=0, summary={"loss": found["loss"], "step": trainee.step, "device": device.type})


def _modules(params: Mapping[str, Any]) -> tuple[str, ...]:
    """The modules that a round finds by name: its kind's, and that of its program."""
    own = (kind_module(params["kind"]),)
    return (*own, program_module(params["program"])) if "program" in params else own


def _seed(task: Task, decision: str) -> int:
    return int(task.rng(decision).integers(2**63))


def _finite(values: Sequence[float] | Any) -> bool:
    return all(abs(value) < float("inf") for value in values)
