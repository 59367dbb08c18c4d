"""Prepared samples on disk: arrays of both splits, and the programs of a category that three kinds learn from."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Self, TypeVar

import numpy.typing as npt

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.sample import read_samples
from stages.shapeassembly.syntax.errors import ProgramError
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
Sample = TypeVar("Sample")


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


def prepare_category(
    task: Task,
    convert: Callable[[str, AssemblyProgram], Sample],
    join: Callable[[list[Sample]], ArrayCorpus],
    count: Callable[[Any], dict[str, int]],
    limit: str,
) -> Outcome:
    """Prepare the programs of a category: write `.<split>.safetensors` for train and val, and `.json`, their counts.

    convert: turns a program, with its key, into a sample; raises ProgramError or Rejected for one to leave out.
    join: makes the corpus of a split.
    count: counts what is in a corpus.
    limit: what is kept, for the error of an empty split.
    Raises Rejected where a split keeps no sample.
    """
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        kept: list[Sample] = []
        for key, program in category_programs(task, split):
            try:
                kept.append(convert(key, program))
            except (ProgramError, Rejected) as error:
                task.reject(key, error.reason, error.detail)
        if not kept:
            raise Rejected(f"{task.shard.params['kit']} has no {limit} in split {split}")
        corpus = join(kept)
        counts[split] = count(corpus)
        write_arrays(task, f"{task.shard.name}.{split}.safetensors", corpus.arrays())
    write_description(task, {"counts": counts})
    return Outcome(samples=0, summary=counts)


def category_programs(task: Task, split: str) -> Iterator[tuple[str, AssemblyProgram]]:
    """Yield the programs of the category in a split, with the keys of their samples."""
    params = task.shard.params
    shards = [shard for shard, of in params["splits"].items() if of == split]
    for done, shard in enumerate(shards):
        for sample in read_samples(task.input(params["producer"], f"{shard}.tar")):
            if sample.kit == params["kit"]:
                yield sample.key, parse(sample.text)
        task.progress(done + 1, len(shards))
