"""The rounds of a training: a chain of shards that each continue the one before."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from pipeline.code import code_digest, transitive_imports
from pipeline.errors import ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.programs.program import program_module
from stages.training.kind import find_kind, kind_module
from stages.training.model_config import ModelConfig, Subject


@dataclass(frozen=True)
class RoundChain:
    """The rounds of one model as far as they are planned.

    shards: the rounds.
    pools: what the rounds learn from, prepared one round ahead so that other workers are busy meanwhile.
    summaries: of the finished rounds.
    best: number of the round with the lowest validation loss.
    ended: whether no further round will be planned.
    """

    shards: tuple[Shard, ...]
    pools: tuple[Shard, ...]
    summaries: tuple[Mapping[str, Any], ...]
    best: int
    ended: bool


def model_name(config: ModelConfig, subject: str, seed: int) -> str:
    """Return the name of a model's shards and folder. The dots of a program module become underscores."""
    return f"{config.name}-{subject.replace('.', '_')}-{seed}"


def subject_fields(params: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a shard's model learns from: `{"kit": name}`, `{"program": name}` or `{"collection": name}`."""
    return {key: params[key] for key in get_args(Subject) if key in params}


def round_chain(
    plan: Plan, config: ModelConfig, kind: str, subject: str, seed: int, data: str, pools: Sequence[Shard] = ()
) -> RoundChain:
    """Plan the rounds of one model, up to `max_rounds`, or until `patience` rounds in a row brought no improvement.

    pools: one for each round; a round reads its own and those of the rounds before.
    Settings that decide about the end, kits and seeds are not among the params of a round: changing them keeps it.
    """
    settings = config.model_dump(mode="json", exclude={"name", "kits", "programs", "seeds", "patience"})
    shards: list[Shard] = []
    summaries: list[Mapping[str, Any]] = []
    best = 0
    for number in range(config.max_rounds):
        name = f"{model_name(config, subject, seed)}-r{number:04}"
        before = [shards[-1].name] if shards else []
        params = {
            "job": "round", "kind": kind, config.subject: subject, "seed": seed, "round": number, "data": data,
            "before": before, "settings": settings,
        }  # fmt: skip
        read = [pool.name for pool in pools[: number + 1]]
        if read:
            params["pools"] = read
        inputs = tuple(f"training/{shard}" for shard in (data, *read, *before))
        shards.append(Shard(name, params, inputs, _modules(params), config.threads))
        summary = plan.summary("training", name)
        if summary is None:
            return RoundChain(tuple(shards), tuple(pools[: number + 2]), tuple(summaries), best, ended=False)
        summaries.append(summary)
        if summary["loss"] < summaries[best]["loss"]:
            best = number
        if number - best >= config.patience:
            break
    return RoundChain(tuple(shards), tuple(pools[: len(shards) + 1]), tuple(summaries), best, ended=True)


def run_round(task: Task) -> Outcome:
    """Train one round.

    Files of the shard: `.safetensors`, weights and moments of the optimiser; `.json`, the figures of the round.
    """
    import torch

    from stages.training.checkpoint import checkpoint_bytes, load_checkpoint
    from stages.training.loop import TrainState, resolve_precision, set_deterministic, train

    params, name = task.shard.params, task.shard.name
    kind = find_kind(params["kind"])
    config = kind.config.model_validate({"name": "round", **params["settings"]})
    set_deterministic(config.threads)
    training = kind.new_task(task, config, _seed(task, "weights"))
    state = TrainState.of(training)
    description = {"kind": params["kind"], **subject_fields(params), "settings": params["settings"], **training.header}
    for before in params["before"]:
        tensors, header = load_checkpoint(task.input("training", f"{before}.safetensors"), description)
        state.restore(tensors, header["step"])
    trained = train(state, task.rng("batches"), task.progress)
    device = training.device
    training.module.eval()
    with torch.no_grad():
        validated = training.validate(torch.Generator(device).manual_seed(_seed(task, "validation")))
    figures = {"round": params["round"], "step": state.step}
    figures |= {f"train_{key}": value for key, value in trained.items()}
    figures |= {f"val_{key}": value for key, value in validated.items()}
    if not all(abs(value) < float("inf") for value in figures.values()):
        raise ShardFailed(f"the training has diverged: {json.dumps(figures)}; try a smaller learning_rate")
    header = {
        **description,
        "step": state.step,
        "code": code_digest(transitive_imports(_modules(params))),
        "device": device.type,
        "precision": resolve_precision(config.precision, device),
        "figures": figures,
    }
    with task.output(f"{name}.safetensors") as stream:
        stream.write(checkpoint_bytes(state.tensors(), header))
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes(figures))
    return Outcome(samples=0, summary={"loss": validated["loss"], "step": state.step, "device": device.type})


def _modules(params: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the modules that a round imports by name: its kind's, and that of its program."""
    own = (kind_module(params["kind"]),)
    return (*own, program_module(params["program"])) if "program" in params else own


def _seed(task: Task, decision: str) -> int:
    return int(task.rng(decision).integers(2**63))
