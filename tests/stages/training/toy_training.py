"""A toy kit and its strings, before the real stage `training`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np

from pipeline.config import Config, StrictModel
from pipeline.paths import DatasetPaths
from pipeline.run import RunResult, run_stage
from pipeline.shards import ShardWriter, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.programs.settings import ProgramsConfig
from stages.shape.arrays import IntArray, TypeArray
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Grammar, Kit, Multiset, PartType
from stages.shape.kit_files import write_kit
from stages.sketches.settings import SketchesConfig
from stages.strings.encoder import canonical_string, random_strings
from stages.strings.settings import StringsConfig
from stages.strings.tokens import Alphabet, make_alphabet
from stages.training.settings import TrainingConfig
from stages.training.stage import STAGE
from tests.stages.shape.collection.absent import named_inputs
from tests.stages.strings.graphs import arrays

LABELS = ("joint", "leaf", "link")
ALPHABET: Alphabet = make_alphabet(LABELS)
SPLITS = {"toys-train-000000": "train", "toys-train-000001": "train", "toys-val-000000": "val"}
SHAPES_PER_SHARD = 10
"""Shapes of a shard."""


class NothingConfig(StrictModel):
    """No keys."""


@cache
def graphs() -> tuple[tuple[TypeArray, IntArray], ...]:
    """Rings and trees of joints, links and leaves; the type of a node is told by its degree."""
    found, seen, rng = [], set(), np.random.default_rng(5)
    while len(found) < SHAPES_PER_SHARD * len(SPLITS):
        graph = nx.cycle_graph(int(rng.integers(3, 6))) if rng.random() < 0.5 else nx.path_graph(2)
        for _ in range(int(rng.integers(2, 7))):
            open_nodes = [node for node, degree in graph.degree if degree < 3]
            graph.add_edge(open_nodes[int(rng.integers(len(open_nodes)))], len(graph))
        types, edges = arrays(graph, np.array([{1: 1, 2: 2}.get(degree, 0) for _, degree in graph.degree]))
        digest = graph_digest(types, edges)
        if digest not in seen:
            seen.add(digest)
            found.append((types, edges))
    return tuple(found)


@cache
def grammar() -> Grammar:
    """What stands around each type in all graphs."""
    around: dict[int, dict[Multiset, int]] = {}
    for types, edges in graphs():
        neighbours: list[list[int]] = [[] for _ in types]
        for i, j in edges.tolist():
            neighbours[i].append(int(types[j]))
            neighbours[j].append(int(types[i]))
        for kind, others in zip(types.tolist(), neighbours, strict=True):
            multiset = tuple((other, others.count(other)) for other in sorted(set(others)))
            around.setdefault(kind, {})[multiset] = 1
    return Grammar(around, (), {})


def kit() -> Kit:
    """The kit of the graphs; its parts have the least of shapes."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)
    types = tuple(
        PartType(name, vertices, faces, np.zeros((4, 3), dtype=np.uint8), np.eye(4), np.eye(4)[None]) for name in LABELS
    )
    return Kit("toy", types, (), grammar(), 0.001, 0.001, ("face",), "z")


def strings(shard: str) -> Iterator[tuple[str, list[str]]]:
    """Digest and strings of each graph of a shard."""
    place = list(SPLITS).index(shard)
    rng = np.random.default_rng(place)
    for types, edges in graphs()[place * SHAPES_PER_SHARD : (place + 1) * SHAPES_PER_SHARD]:
        canonical = canonical_string(types, edges, ALPHABET).string
        others = random_strings(types, edges, ALPHABET, 4, rng, {canonical})
        yield graph_digest(types, edges), [canonical, *(other.string for other in others)]


def make_kit(task: Task) -> Outcome:
    with task.output("toy.json") as text, task.output("toy.tar") as tar:
        write_kit(kit(), text, tar)
    return Outcome(1)


def make_strings(task: Task) -> Outcome:
    name, rows = task.shard.name, []
    with task.output(f"{name}.tar") as stream, ShardWriter(stream) as writer:
        for number, (digest, item) in enumerate(strings(name)):
            writer.write(f"{name}-{number}", {"txt": "\n".join(item).encode()})
            rows.append({"key": f"{name}-{number}", "kit": "toy", "graph": digest})
    with task.output(f"{name}.jsonl") as listing:
        listing.writelines(map(json_bytes, rows))
    return Outcome(SHAPES_PER_SHARD, {"split": SPLITS[name]})


def plan_strings(plan: Plan) -> list[Shard]:
    return [Shard(name, inputs=("exemplars/toy",)) for name in SPLITS]


STAGES: Mapping[str, Stage] = named_inputs(
    [
        Stage("exemplars", __name__, NothingConfig, (), lambda _: [Shard("toy")], make_kit, lambda _: 0),
        Stage("strings", __name__, StringsConfig, ("exemplars",), plan_strings, make_strings, lambda _: 0),
        STAGE,
    ]
)

TINY: Mapping[str, Any] = {
    "kind": "string_vae", "name": "tiny", "decoder": "masked", "latent": 4, "embedding": 4, "hidden": 8,
"batch_size": 16,
    "steps": 4, "max_rounds": 4, "anneal_steps": 8,
}  # fmt: skip


def config(*models: Mapping[str, Any]) -> Config:
    """A config with models like TINY, each with its own changes; one without any."""
    entries = [{**TINY, **changes} for changes in models or ({},)]
    training = TrainingConfig.model_validate_json(json_bytes({"models": entries}))
    sections = {"exemplars": NothingConfig(), "strings": StringsConfig(), "training": training}
    sections |= {"programs": ProgramsConfig(), "sketches": SketchesConfig()}
    return Config("toys", "1.0.0", 3, sections, Path("toys.yaml"), license="CC0-1.0")


def train(wanted: Config, out: Path, workers: int = 1, only: str = "") -> RunResult:
    """Run all three stages."""
    for name in ("exemplars", "strings"):
        run_stage(name, STAGES, wanted, DatasetPaths(out, wanted.name), 1)
    return run_stage("training", STAGES, wanted, DatasetPaths(out, wanted.name), workers, only=only)
