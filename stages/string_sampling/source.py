"""A trained model as a source of shapes, copied into the pipeline's folder with its training graphs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import ConfigError, Rejected, ShardFailed
from pipeline.paths import file_digest
from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Kit
from stages.shape.kit_input import input_kit
from stages.string_sampling.settings import SourceConfig
from stages.strings.decoder import decode
from stages.strings.settings import Edges
from stages.strings.tokens import make_alphabet

if TYPE_CHECKING:
    from stages.training.string_vae.trained import TrainedStringVae


@dataclass(frozen=True)
class ModelSource:
    """A model and its training data."""

    model: TrainedStringVae
    strings: list[str]
    """Training strings that it can encode."""
    known: frozenset[bytes]
    """Digests of the graphs of training strings."""
    edges: Edges
    """The contacts in its strings."""
    weights: str
    """sha256 of its weights."""

    @property
    def whole(self) -> bool:
        """Whether its strings have all contacts."""
        return self.edges == "all"


def source_shard(plan: Plan, number: int, source: SourceConfig) -> Shard:
    """Return the shard that copies a model. Raises ConfigError for a missing one, with the command that makes it."""
    name = f"{source.model}-{source.kit}-{source.seed}"
    files = {
        "weights": f"{source.dataset}-models/{name}/weights.safetensors",
        "corpus": f"{source.dataset}-corpus/{source.kit}-train.txt",
        "vocabulary": f"{source.dataset}-corpus/vocabulary.json",
    }
    digests = {}
    for role, file in files.items():
        path = plan.published(file)
        if not path.is_file():
            mend = f"make train with its config and MODEL={source.model}" if role == "weights" else "make strings there"
            raise ConfigError(
                f"{plan.config.path}: string_sampling.sources[item {number + 1}]: there is no {path}: dataset"
                f" {source.dataset} has no "
                f"{role} of {name if role == 'weights' else source.kit}; {mend} first"
            )
        digests[role] = file_digest(path)
    params = {"job": "source", "kit": source.kit, "files": files, "digests": digests}
    return Shard(f"s{number:02}-source", params, (f"exemplars/{source.kit}",))


def run_source(task: Task) -> Outcome:
    """Copy a model and its training data.

    `.weights.safetensors`; `.strings.txt`: training strings that the model can encode; `.json`: the contacts in them;
    `.known.npy`: uint8 (k, 32), distinct digests of their graphs, ascending. Raises Rejected for unreadable weights,
    and for those of another kit.
    """
    from stages.training.checkpoint import CheckpointError
    from stages.training.string_vae.trained import load_string_vae

    params, name = task.shard.params, task.shard.name
    contents: dict[str, bytes] = {}
    for role, file in params["files"].items():
        path = task.published(file)
        if file_digest(path) != params["digests"][role]:
            raise ShardFailed(f"{path} has changed since the run began")
        contents[role] = path.read_bytes()
    with task.output(f"{name}.weights.safetensors") as stream:
        stream.write(contents["weights"])
    kit = input_kit(task, params["kit"])
    try:
        model = load_string_vae(task.published(params["files"]["weights"]), _expected(kit))
    except CheckpointError as error:
        raise Rejected(str(error)) from error
    _check_grammar(kit, model.header["patterns"])
    alphabet = make_alphabet(kit.labels)
    strings = [line for line in contents["corpus"].decode().splitlines() if model.is_valid(line)]
    known: set[bytes] = set()
    for done, string in enumerate(strings):
        decoded = decode(string, alphabet)
        known.add(bytes.fromhex(graph_digest(decoded.types, decoded.edges)))
        task.progress(done + 1, len(strings))
    with task.output(f"{name}.strings.txt") as stream:
        stream.write("".join(f"{string}\n" for string in strings).encode())
    with task.output(f"{name}.known.npy") as stream:
        stream.write(array_bytes(np.frombuffer(b"".join(sorted(known)), dtype=np.uint8).reshape(-1, 32)))
    edges = json.loads(contents["vocabulary"])[kit.name]["edges"]
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes({"edges": edges}))
    return Outcome(0, {"strings": len(strings), "graphs": len(known), "weights": params["digests"]["weights"]})


def read_source(task: Task, shard: str, kit: Kit) -> ModelSource:
    """Read the result of `run_source`, one of the inputs."""
    from stages.training.string_vae.trained import load_string_vae

    path: Path = task.input("string_sampling", f"{shard}.weights.safetensors")
    model = load_string_vae(path, _expected(kit))
    strings = task.input("string_sampling", f"{shard}.strings.txt").read_text(encoding="utf-8").splitlines()
    known = np.load(task.input("string_sampling", f"{shard}.known.npy"), allow_pickle=False)
    digests = frozenset(bytes(digest) for digest in known)
    edges = json.loads(task.input("string_sampling", f"{shard}.json").read_bytes())["edges"]
    return ModelSource(model, strings, digests, edges, file_digest(path))


def _expected(kit: Kit) -> dict[str, Any]:
    return {"kit": kit.name, "names": list(kit.labels)}


def _check_grammar(kit: Kit, patterns: Mapping[str, Any]) -> None:
    """Raise Rejected for a model trained on another grammar than that of the kit."""
    from stages.strings.compiled_grammar import compile_grammar, patterns_json

    own = patterns_json(compile_grammar(kit.grammar, len(kit.labels), 0, bool(patterns["partial"])))
    if own != {key: patterns[key] for key in own}:
        raise Rejected(
            f"the model was trained on another grammar than that of kit {kit.name}: give the kit the same exemplars"
        )
