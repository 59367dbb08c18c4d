"""The programs of a category, made ready: read once from the collection, as numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.sample import read_samples
from stages.shapeassembly.editing.ablations import unaligned, unordered, without_macros
from stages.shapeassembly.editing.flattening import without_hierarchy
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.parser import parse
from stages.shapeassembly.syntax.program import Program
from stages.training.program_vae.batches import Programs
from stages.training.program_vae.lines import NodeLines, node_lines
from stages.training.program_vae.settings import Without


def prepare_corpus(task: Task) -> Outcome:
    """Files of the shard: `.<split>.safetensors`, the `Programs` of train and val; `.json`, how many there are.

    Programs that 63 numbers a line cannot say, and those of more than `longest` lines, are refused. Raises Rejected
    where train or val keeps no program.
    """
    from safetensors.numpy import save

    params, name = task.shard.params, task.shard.name
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        kept: list[list[NodeLines]] = []
        for key, program in category_programs(task, split):
            try:
                nodes = node_lines(told_without(program, params.get("without", "nothing"), task.rng("order", key)))
            except (ProgramError, Rejected) as error:
                task.reject(key, error.reason, str(error))
                continue
            if sum(len(node.numbers) for node in nodes) > params["longest"]:
                task.reject(key, "longer than training.longest")
                continue
            kept.append(nodes)
        if not kept:
            raise Rejected(f"{params['kit']} has no programs of at most {params['longest']} lines in split {split}")
        programs = Programs.of(kept)
        counts[split] = {"programs": len(programs), "assemblies": len(programs.boxes), "lines": len(programs.lines)}
        with task.output(f"{name}.{split}.safetensors") as stream:
            stream.write(save(programs.arrays()))
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes({"counts": counts}))
    return Outcome(samples=0, summary=counts)


def told_without(program: Program, without: Without, rng: np.random.Generator) -> Program:
    """The program without a part of the language. Raises ProgramError and Rejected where it cannot be told so."""
    if without == "hierarchy":
        return without_hierarchy(program)
    if without == "macros":
        return without_macros(program)
    if without == "order":
        return unordered(program, rng)
    return unaligned(program) if without == "align" else program


def read_corpus(task: Task, data: str) -> tuple[dict[str, Any], dict[str, Programs]]:
    """What `prepare_corpus` wrote in shard `data`: the counts, and the programs of train and val."""
    from safetensors.numpy import load_file

    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    paths = {split: task.input("training", f"{data}.{split}.safetensors") for split in ("train", "val")}
    return described, {split: Programs.of_arrays(load_file(path)) for split, path in paths.items()}


def category_programs(task: Task, split: str) -> Iterator[tuple[str, Program]]:
    """The programs of the category in a split, with the keys of their samples."""
    params = task.shard.params
    shards = [shard for shard, of in params["splits"].items() if of == split]
    for done, shard in enumerate(shards):
        for sample in read_samples(task.input(params["producer"], f"{shard}.tar")):
            if sample.kit == params["kit"]:
                yield sample.key, parse(sample.text)
        task.progress(done + 1, len(shards))
