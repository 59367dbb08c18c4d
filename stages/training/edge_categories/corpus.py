"""The strings of a kit's shapes with their categories, made ready: read once from the collection, shape by shape."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.errors import Rejected
from pipeline.shards import array_bytes, bytes_array, json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.kit import Assembly
from stages.shape.kit_input import input_kit
from stages.shape.sample import read_samples
from stages.strings.categories import CategorySpace, NoCategoryError
from stages.strings.encoder import NotConnectedError
from stages.strings.kit_strings import KitStrings
from stages.training.edge_categories.batches import CategoryTables, LabelledStrings, read_string

MAX_CYCLES = 16
"""Cycle numbers that are told apart; the greater ones are read as the last of these."""


def prepare_corpus(task: Task) -> Outcome:
    """Files of the shard: `.<split>.rows`, the rows of `LabelledStrings` of train and val as they stand in memory, with
    `.<split>.first.npy` and `.<split>.graph.npy`; `.masks.npy` and `.poses.npy`, the `CategoryTables`
    of the kit; `.json`, what weights say of themselves.

    Strings are drawn anew, as many of each shape as stage `strings` writes: a text does not say which part a token is.
    Left out are strings of more than `longest` tokens, those of val that train has as well, and shapes that fall into
    pieces or have parts that stand as the kit has not seen them. Raises Rejected where train or val keeps no string.
    """
    params, name = task.shard.params, task.shard.name
    space = CategorySpace(input_kit(task, params["kit"]))
    writer = KitStrings(space.kit, params["edges"])
    learnt: set[str] = set()
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        lengths, graph, shapes = [0], list[int](), 0
        with task.output(f"{name}.{split}.rows") as stream:
            for key, assembly in _shapes(task, split):
                try:
                    strings = writer.strings(writer.graph(assembly), params["strings"], task.rng(key))
                    found = space.label(assembly, strings, either_hand=True)
                except (NotConnectedError, NoCategoryError) as error:
                    task.reject(key, "has no categories", str(error))
                    continue
                before = len(graph)
                for each in found:
                    if len(each.categories) > params["longest"]:
                        task.reject(key, "longer than training.max_length")
                    elif split == "val" and each.string in learnt:
                        task.reject(each.string, "stands in train as well")
                    else:
                        rows = np.column_stack([read_string(each.string, space.alphabet, MAX_CYCLES), each.categories])
                        stream.write(rows.astype("<i2").tobytes())
                        lengths.append(len(rows))
                        graph.append(shapes)
                        if split == "train":
                            learnt.add(each.string)
                shapes += len(graph) > before
        with task.output(f"{name}.{split}.first.npy") as first, task.output(f"{name}.{split}.graph.npy") as graphs:
            first.write(array_bytes(np.cumsum(lengths, dtype=np.int64)))
            graphs.write(array_bytes(np.array(graph, dtype=np.int32)))
        if not graph:
            raise Rejected(f"kit {params['kit']} has no strings of at most {params['longest']} tokens in split {split}")
        counts[split] = {"strings": len(graph), "graphs": shapes, "tokens": sum(lengths)}
    for what, array in vars(CategoryTables.of(space)).items():
        with task.output(f"{name}.{what}.npy") as stream:
            stream.write(array_bytes(array))
    described = {**describe_space(space), "cycles": MAX_CYCLES, "counts": counts}
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes(described))
    return Outcome(samples=0, summary=counts)


def read_corpus(task: Task, data: str) -> tuple[dict[str, Any], CategoryTables, dict[str, LabelledStrings]]:
    """What `prepare_corpus` wrote in shard `data`: a description, the tables, and the strings of train and val, mapped
    from their files."""
    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    strings = {}
    for split in ("train", "val"):
        rows = np.memmap(task.input("training", f"{data}.{split}.rows"), dtype="<i2", mode="r").reshape(-1, 4)
        first, graph = (_array(task, f"{data}.{split}.{each}") for each in ("first", "graph"))
        strings[split] = LabelledStrings(rows, first, graph)
    return described, CategoryTables(_array(task, f"{data}.masks"), _array(task, f"{data}.poses")), strings


def describe_space(space: CategorySpace) -> dict[str, Any]:
    """What weights say of the categories that they know: the labels of the kit, and how many places each pair of types
    has."""
    places = [[a, b, len(pair.poses)] for (a, b), pair in space.pairs.items()]
    return {"names": list(space.kit.labels), "places": places}


def _shapes(task: Task, split: str) -> Iterator[tuple[str, Assembly]]:
    """The key and the assembly of each shape of the kit in a split, but those with stretched parts, whose contacts are
    of no category."""
    params = task.shard.params
    shards = [shard for shard, of in params["splits"].items() if of == split]
    for done, shard in enumerate(shards):
        for sample in read_samples(task.input(params["producer"], f"{shard}.tar")):
            if sample.kit == params["kit"] and sample.assembly.stretches is None:
                yield sample.key, sample.assembly
        task.progress(done + 1, len(shards))


def _array(task: Task, name: str) -> npt.NDArray[Any]:
    return bytes_array(task.input("training", f"{name}.npy").read_bytes())
