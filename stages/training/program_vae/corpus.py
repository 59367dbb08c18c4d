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
from stages.shapeassembly.editing.ablations import without_alignment, without_macros, without_order
from stages.shapeassembly.editing.flattening import without_hierarchy
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.parser import parse
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.program_vae.batches import ProgramCorpus
from stages.training.program_vae.lines import AssemblyLines, assembly_lines
from stages.training.program_vae.settings import Ablation


def prepare_corpus(task: Task) -> Outcome:
    """Files of the shard: `.<split>.safetensors`, the `ProgramCorpus` of train and val; `.json`, how many there are.

    Programs that 63 numbers a line cannot say, and those of more than `longest` lines, are refused. Raises Rejected
    where train or val keeps no program.
    """
    from safetensors.numpy import save

    params, name = task.shard.params, task.shard.name
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        kept: list[list[AssemblyLines]] = []
        for key, program in category_programs(task, split):
            try:
                nodes = assembly_lines(ablate_program(program, params.get("ablate", "nothing"), task.rng("order", key)))
            except (ProgramError, Rejected) as error:
                task.reject(key, error.reason, str(error))
                continue
            if sum(len(node.numbers) for node in nodes) > params["longest"]:
                task.reject(key, "longer than training.max_length")
                continue
            kept.append(nodes)
        if not kept:
            raise Rejected(f"{params['kit']} has no programs of at most {params['longest']} lines in split {split}")
        programs = ProgramCorpus.of(kept)
        counts[split] = {"programs": len(programs), "assemblies": len(programs.boxes), "lines": len(programs.lines)}
        with task.output(f"{name}.{split}.safetensors") as stream:
            stream.write(save(programs.arrays()))
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes({"counts": counts}))
    return Outcome(samples=0, summary=counts)


def ablate_program(program: AssemblyProgram, without: Ablation, rng: np.random.Generator) -> AssemblyProgram:
    """The program without a part of the language. Raises ProgramError and Rejected where it cannot be told so."""
    if without == "hierarchy":
        return without_hierarchy(program)
    if without == "macros":
        return without_macros(program)
    if without == "order":
        return without_order(program, rng)
    return without_alignment(program) if without == "align" else program


def read_corpus(task: Task, data: str) -> tuple[dict[str, Any], dict[str, ProgramCorpus]]:
    """What `prepare_corpus` wrote in shard `data`: the counts, and the programs of train and val."""
    from safetensors.numpy import load_file

    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    paths = {split: task.input("training", f"{data}.{split}.safetensors") for split in ("train", "val")}
    return described, {split: ProgramCorpus.of_arrays(load_file(path)) for split, path in paths.items()}


def category_programs(task: Task, split: str) -> Iterator[tuple[str, AssemblyProgram]]:
    """The programs of the category in a split, with the keys of their samples."""
    params = task.shard.params
    shards = [shard for shard, of in params["splits"].items() if of == split]
    for done, shard in enumerate(shards):
        for sample in read_samples(task.input(params["producer"], f"{shard}.tar")):
            if sample.kit == params["kit"]:
                yield sample.key, parse(sample.text)
        task.progress(done + 1, len(shards))
