"""Prepared samples on disk: arrays of both splits, and the programs of a category that three kinds learn from."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any, Self, TypeVar

import numpy.typing as npt

from pipeline.shards import json_bytes
from pipeline.stage import Task
from stages.shape.sample import read_samples
from stages.shapeassembly.syntax.parser import parse
from stages.shapeassembly.syntax.program import AssemblyProgram

Arrays = Mapping[str, npt.NDArray[Any]]


class ArrayCorpus:
    """Samples of one split as arrays: the fields of a frozen dataclass."""

    @classmethod
    def of_arrays(cls, arrays: Arrays) -> Self:
        """Build the corpus from the arrays of its fields, by name."""
        return cls(**{name: arrays[name] for name in cls.__dataclass_fields__})  # type: ignore[attr-defined]

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the arrays by name."""
        return dict(vars(self))


Corpus = TypeVar("Corpus", bound=ArrayCorpus)


def write_arrays(task: Task, file: str, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write arrays as a safetensors file of the shard."""
    from safetensors.numpy import save

    with task.output(file) as stream:
        stream.write(save(dict(arrays)))


def write_description(task: Task, description: Mapping[str, Any]) -> None:
    """Write `<shard>.json`: counts, and what else a header needs."""
    with task.output(f"{task.shard.name}.json") as stream:
        stream.write(json_bytes(description))


def read_description(task: Task) -> dict[str, Any]:
    """Read what `write_description` wrote, in a round's shard."""
    description: dict[str, Any] = json.loads(task.input("training", f"{task.shard.params['data']}.json").read_bytes())
    return description


def read_arrays(task: Task, suffix: str) -> dict[str, npt.NDArray[Any]]:
    """Read what `write_arrays` wrote as `<shard>.<suffix>.safetensors`, in a round's shard."""
    from safetensors.numpy import load_file

    return load_file(task.input("training", f"{task.shard.params['data']}.{suffix}.safetensors"))


def read_splits(task: Task, corpus: type[Corpus]) -> dict[str, Corpus]:
    """Read the corpora of train and val, in a round's shard."""
    return {split: corpus.of_arrays(read_arrays(task, split)) for split in ("train", "val")}


def category_programs(task: Task, split: str) -> Iterator[tuple[str, AssemblyProgram]]:
    """Yield the programs of the category in a split, with the keys of their samples."""
    params = task.shard.params
    shards = [shard for shard, of in params["splits"].items() if of == split]
    for done, shard in enumerate(shards):
        for sample in read_samples(task.input(params["producer"], f"{shard}.tar")):
            if sample.kit == params["kit"]:
                yield sample.key, parse(sample.text)
        task.progress(done + 1, len(shards))
