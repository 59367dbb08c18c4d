"""Prepare the strings of a kit's shapes with their edge categories."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.errors import Rejected
from pipeline.shards import array_bytes, bytes_array
from pipeline.stage import Outcome, Task
from stages.shape.kit import Assembly
from stages.shape.kit_input import input_kit
from stages.shape.sample import read_samples
from stages.strings.categories import CategorySpace, NoCategoryError
from stages.strings.encoder import NotConnectedError
from stages.strings.kit_strings import KitStrings
from stages.training.corpus import write_description
from stages.training.edge_categories.batches import CategoryTables, LabelledStrings, read_string

MAX_CYCLES = 16
"""Distinct cycle numbers; greater ones share the last code."""


def prepare(task: Task) -> Outcome:
    """Sample labelled strings of the shapes of train and val.

    Files of the shard:
        `.<split>.rows`, `.<split>.first.npy`, `.<split>.graph.npy`: the fields of `LabelledStrings`
        `.masks.npy`, `.poses.npy`: the `CategoryTables` of the kit
        `.json`: the header's description
    Strings are sampled again, as many a shape as stage `strings` writes, since a text does not tell which part a token
    is. Rejects strings of more than `max_length` tokens, strings of val that train has too, and shapes that are not
    connected or hold placements that the kit does not have. Raises Rejected where a split keeps no string.
    """
    params, name = task.shard.params, task.shard.name
    space = CategorySpace(input_kit(task, params["kit"]))
    writer = KitStrings(space.kit, params["edges"])
    train_strings: set[str] = set()
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        lengths, graph, shapes = [0], list[int](), 0
        with task.output(f"{name}.{split}.rows") as stream:
            for key, assembly in _shapes(task, split):
                try:
                    strings = writer.strings(writer.graph(assembly), params["strings"], task.rng(key))
                    labelled = space.label(assembly, strings, either_hand=True)
                except (NotConnectedError, NoCategoryError) as error:
                    task.reject(key, "has no categories", str(error))
                    continue
                before = len(graph)
                for string in labelled:
                    if len(string.categories) > params["max_length"]:
                        task.reject(key, "longer than training.max_length")
                    elif split == "val" and string.string in train_strings:
                        task.reject(string.string, "occurs in train too")
                    else:
                        rows = np.column_stack(
                            [read_string(string.string, space.alphabet, MAX_CYCLES), string.categories]
                        )
                        stream.write(rows.astype("<i2").tobytes())
                        lengths.append(len(rows))
                        graph.append(shapes)
                        if split == "train":
                            train_strings.add(string.string)
                shapes += len(graph) > before
        _write_array(task, f"{split}.first", np.cumsum(lengths, dtype=np.int64))
        _write_array(task, f"{split}.graph", np.array(graph, dtype=np.int32))
        if not graph:
            raise Rejected(f"kit {params['kit']} has no strings of at most {params['longest']} tokens in split {split}")
        counts[split] = {"strings": len(graph), "graphs": shapes, "tokens": sum(lengths)}
    for field, array in vars(CategoryTables.of(space)).items():
        _write_array(task, field, array)
    write_description(task, {**describe_space(space), "cycles": MAX_CYCLES, "counts": counts})
    return Outcome(samples=0, summary=counts)


def read_corpus(task: Task) -> tuple[CategoryTables, dict[str, LabelledStrings]]:
    """Read what `prepare` wrote, in a round's shard: the tables, and the strings of both splits, memory-mapped."""
    strings = {}
    for split in ("train", "val"):
        rows = np.memmap(task.input("training", f"{task.shard.params['data']}.{split}.rows"), dtype="<i2", mode="r")
        first, graph = (_read_array(task, f"{split}.{field}") for field in ("first", "graph"))
        strings[split] = LabelledStrings(rows.reshape(-1, 4), first, graph)
    return CategoryTables(_read_array(task, "masks"), _read_array(task, "poses")), strings


def describe_space(space: CategorySpace) -> dict[str, Any]:
    """Describe the categories of a kit for a header: its labels, and the number of poses of each pair of types."""
    places = [[a, b, len(pair.poses)] for (a, b), pair in space.pairs.items()]
    return {"names": list(space.kit.labels), "places": places}


def _shapes(task: Task, split: str) -> Iterator[tuple[str, Assembly]]:
    """Yield key and assembly of each shape of the kit in a split.

    Stretched shapes are left out: their contacts have no category. So are samples of other producers, without assembly.
    """
    params = task.shard.params
    shards = [shard for shard, of in params["splits"].items() if of == split]
    for done, shard in enumerate(shards):
        for sample in read_samples(task.input(params["producer"], f"{shard}.tar")):
            stretched = sample.assembly.stretches is not None
            if sample.kit == params["kit"] and len(sample.assembly) and not stretched:
                yield sample.key, sample.assembly
        task.progress(done + 1, len(shards))


def _write_array(task: Task, name: str, array: npt.NDArray[Any]) -> None:
    with task.output(f"{task.shard.name}.{name}.npy") as stream:
        stream.write(array_bytes(array))


def _read_array(task: Task, name: str) -> npt.NDArray[Any]:
    return bytes_array(task.input("training", f"{task.shard.params['data']}.{name}.npy").read_bytes())
