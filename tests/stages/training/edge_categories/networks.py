"""Toy shapes with known placements: posts on a grid and rods between them; and the pipeline before training."""

from __future__ import annotations

from collections.abc import Mapping
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
from stages.shape.collection.shards import PRODUCERS
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import write_kit
from stages.shape.sample import Sample, write_sample
from stages.sketches.settings import SketchesConfig
from stages.strings.categories import CategorySpace
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import StringsConfig
from stages.training.edge_categories.batches import CategoryTables, LabelledStrings, read_string
from stages.training.edge_categories.model import make_model
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.edge_categories.trained import TrainedEdgeCategories
from stages.training.edge_categories.training import EdgeCategoriesTask, new_model
from stages.training.loop import TrainState, train
from stages.training.settings import TrainingConfig
from stages.training.stage import STAGE
from tests.stages.shape.collection.absent import ABSENT_SECTIONS, ABSENT_STAGES, named_inputs
from tests.toy_kits.chains_and_rings import Placed, box, pose, with_arrow
from tests.toy_kits.chains_and_rings import kit_of as toy_kit

MAX_CYCLE_NUMBERS = 4
SPLITS = {"nets-train-000000": "train", "nets-train-000001": "train", "nets-val-000000": "val"}
SHAPES_PER_SHARD = 6
"""Shapes of a shard."""


class NothingConfig(StrictModel):
    """No keys."""


@cache
def kit() -> Kit:
    """Posts of eight symmetries, rods of four, and signs of none that hang on posts."""
    meshes = {"post": box(1, 2, 1), "rod": box(2, 0.4, 0.6), "sign": with_arrow(box(0.2, 0.6, 0.6))}
    row: list[Placed] = [("post", pose(0, 0, 0)), ("rod", pose(1.5, 0, 0)), ("post", pose(3, 0, 0))]
    signed: list[Placed] = [*row, ("sign", pose(3.6, 0, 0))]
    return toy_kit(meshes, [row, signed])


@cache
def space() -> CategorySpace:
    return CategorySpace(kit())


@cache
def writer() -> KitStrings:
    return KitStrings(kit(), "all")


@cache
def network(seed: int, size: int = 4) -> Assembly:
    """A connected piece of a grid of posts and rods, with a sign; rods lead from posts to the next ones."""
    rng = np.random.default_rng(seed)
    grid = nx.grid_2d_graph(3, 3)
    posts = [(int(rng.integers(3)), int(rng.integers(3)))]
    while len(posts) < size:
        free = sorted({item for post in posts for item in grid[post]} - set(posts))
        posts.append(free[int(rng.integers(len(free)))])
    types, poses, edges = [0] * size, [pose(3 * x, 0, 3 * z) for x, z in posts], []
    for first, second in sorted(grid.subgraph(posts).edges):
        (x, z), (to_x, to_z) = first, second
        edges += [(posts.index(end), len(types)) for end in (first, second)]
        types.append(1)
        poses.append(pose(1.5 * (x + to_x), 0, 1.5 * (z + to_z), int(x == to_x)))
    x, z = posts[0]
    taken = {(to_x - x, to_z - z) for to_x, to_z in grid.subgraph(posts)[posts[0]]}
    side = next(turn for turn, step in enumerate(((1, 0), (0, -1), (-1, 0), (0, 1))) if step not in taken)
    step = ((1, 0), (0, -1), (-1, 0), (0, 1))[side]
    edges.append((0, len(types)))
    types.append(2)
    poses.append(pose(3 * x + 0.6 * step[0], 0, 3 * z + 0.6 * step[1], side))
    ends = np.sort(np.array(edges), axis=1)
    return Assembly(
        np.array(types, np.int16), np.array(poses), ends[np.lexsort((ends[:, 1], ends[:, 0]))].astype(np.int32)
    )


def labelled(assembly: Assembly, count: int, seed: int) -> list[np.ndarray]:
    """Rows of `LabelledStrings` of an assembly."""
    strings = writer().strings(writer().graph(assembly), count, np.random.default_rng(seed))
    found = space().label(assembly, strings, either_hand=True)
    return [
        np.column_stack([read_string(item.string, space().alphabet, MAX_CYCLE_NUMBERS), item.categories]).astype(
            np.int16
        )
        for item in found
    ]


def strings_of(shapes: int) -> LabelledStrings:
    item = [labelled(network(seed), 3, seed) for seed in range(shapes)]
    rows = [row for of_shape in item for row in of_shape]
    return LabelledStrings(
        np.concatenate(rows),
        np.cumsum([0, *map(len, rows)]),
        np.repeat(np.arange(shapes, dtype=np.int32), [len(of_shape) for of_shape in item]),
    )


def entry(**changes: Any) -> EdgeCategoriesConfig:
    """Settings of a model that learns in seconds."""
    settings = {"kind": "edge_categories", "name": "tiny", "embedding": 8, "hidden": 32, "layers": 1, "batch_size": 16}
    return EdgeCategoriesConfig.model_validate({**settings, "steps": 150, "max_rounds": 1, **changes})


def header(settings: EdgeCategoriesConfig) -> dict[str, Any]:
    """What weights say of themselves."""
    places = [[a, b, len(pair.poses)] for (a, b), pair in space().pairs.items()]
    return {
        "kind": "edge_categories",
        "kit": "toy",
        "settings": settings.model_dump(mode="json", exclude={"name", "kits", "seeds", "patience"}),
        "names": list(kit().labels),
        "places": places,
        "cycles": MAX_CYCLE_NUMBERS,
    }


def random_model(**changes: Any) -> TrainedEdgeCategories:
    """A model with random weights, which are larger than fresh ones, so that it has preferences."""
    import torch

    settings = entry(**changes)
    module = new_model(settings, CategoryTables.of(space()), MAX_CYCLE_NUMBERS, 0)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.mul_(2.0)
    return TrainedEdgeCategories(module.eval(), space(), header(settings))


def learner(settings: EdgeCategoriesConfig, shapes: int = 12) -> EdgeCategoriesTask:
    """A learner of some shapes, on which it is validated as well."""
    strings = strings_of(shapes)
    return EdgeCategoriesTask(
        new_model(settings, CategoryTables.of(space()), MAX_CYCLE_NUMBERS, 1),
        {},
        settings,
        strings,
        strings,
        CategoryTables.of(space()),
    )


@cache
def trained_model(**changes: Any) -> TrainedEdgeCategories:
    """A model that has learnt some shapes."""
    settings = entry(learning_rate=0.01, **changes)
    learning = learner(settings)
    train(TrainState.of(learning), np.random.default_rng(2), lambda done, total: None)
    module = make_model(settings, CategoryTables.of(space()), MAX_CYCLE_NUMBERS)
    module.load_state_dict(learning.module.state_dict())
    return TrainedEdgeCategories(module.eval(), space(), header(settings))


def make_kit(task: Task) -> Outcome:
    with task.output("toy.json") as text, task.output("toy.tar") as tar:
        write_kit(kit(), text, tar)
    return Outcome(1)


def make_shapes(task: Task) -> Outcome:
    name = task.shard.name
    place = list(SPLITS).index(name)
    with task.output(f"{name}.tar") as stream, ShardWriter(stream) as written:
        for number in range(place * SHAPES_PER_SHARD, (place + 1) * SHAPES_PER_SHARD):
            key = f"{name}-{number}"
            write_sample(written, Sample(key, SPLITS[name], "variations", "toy", key, {}, network(number, 3 + place)))
    return Outcome(SHAPES_PER_SHARD, {"split": SPLITS[name], "samples": SHAPES_PER_SHARD})


def plan_shapes(plan: Plan) -> list[Shard]:
    return [Shard(name, inputs=("exemplars/toy",)) for name in SPLITS]


STAGES: Mapping[str, Stage] = named_inputs(
    [
        Stage("exemplars", __name__, NothingConfig, (), lambda _: [Shard("toy")], make_kit, lambda _: 0),
        Stage("variations", __name__, NothingConfig, ("exemplars",), plan_shapes, make_shapes, lambda _: 0),
        *ABSENT_STAGES.values(),
        Stage("strings", __name__, StringsConfig, (PRODUCERS,), lambda _: [], make_shapes, lambda _: 0),
        STAGE,
    ]
)


def config(strings: Mapping[str, Any] | None = None, **changes: Any) -> Config:
    """A config with one model."""
    model = entry(steps=4, max_rounds=2, **changes).model_dump(mode="json")
    training = TrainingConfig.model_validate_json(json_bytes({"models": [model], "max_length": 60}))
    sections: dict[str, StrictModel] = {"exemplars": NothingConfig(), "variations": NothingConfig()}
    sections |= {
        **ABSENT_SECTIONS,
        "sketches": SketchesConfig(),
        "strings": StringsConfig(**(strings or {})),
        "training": training,
    }
    return Config("nets", "1.0.0", 3, sections, Path("nets.yaml"), license="CC0-1.0")


def train_networks(wanted: Config, out: Path) -> RunResult:
    """Run all stages."""
    for name in ("exemplars", "variations"):
        run_stage(name, STAGES, wanted, DatasetPaths(out, wanted.name), 1)
    return run_stage("training", STAGES, wanted, DatasetPaths(out, wanted.name), 1)
