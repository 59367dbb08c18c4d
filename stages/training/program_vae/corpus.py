"""Prepare the programs of a category as arrays of lines."""

from __future__ import annotations

import numpy as np

from pipeline.errors import Rejected
from pipeline.stage import Outcome, Task
from stages.shapeassembly.editing.ablations import without_alignment, without_macros, without_order
from stages.shapeassembly.editing.flattening import without_hierarchy
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.corpus import category_programs, write_arrays, write_description
from stages.training.program_vae.batches import ProgramCorpus
from stages.training.program_vae.lines import AssemblyLines, assembly_lines
from stages.training.program_vae.settings import Ablation


def prepare(task: Task) -> Outcome:
    """Write `.<split>.safetensors`, the `ProgramCorpus` of train and val, and `.json`, their counts.

    Rejects programs that 63 numbers a line cannot represent, and those of more than `max_length` lines. Raises Rejected
    where a split keeps no program.
    """
    params = task.shard.params
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        kept: list[list[AssemblyLines]] = []
        for key, program in category_programs(task, split):
            try:
                ablated = ablate_program(program, params.get("ablate", "nothing"), task.rng("order", key))
                assemblies = assembly_lines(ablated)
            except (ProgramError, Rejected) as error:
                task.reject(key, error.reason, str(error))
                continue
            if sum(len(assembly.numbers) for assembly in assemblies) > params["max_length"]:
                task.reject(key, "longer than training.max_length")
                continue
            kept.append(assemblies)
        if not kept:
            raise Rejected(f"{params['kit']} has no programs of at most {params['max_length']} lines in split {split}")
        programs = ProgramCorpus.of(kept)
        counts[split] = {"programs": len(programs), "assemblies": len(programs.boxes), "lines": len(programs.lines)}
        write_arrays(task, f"{task.shard.name}.{split}.safetensors", programs.arrays())
    write_description(task, {"counts": counts})
    return Outcome(samples=0, summary=counts)


def ablate_program(program: AssemblyProgram, ablation: Ablation, rng: np.random.Generator) -> AssemblyProgram:
    """Rewrite a program without a part of the language. Raises ProgramError and Rejected where that is impossible."""
    if ablation == "hierarchy":
        return without_hierarchy(program)
    if ablation == "macros":
        return without_macros(program)
    if ablation == "order":
        return without_order(program, rng)
    return without_alignment(program) if ablation == "align" else program
