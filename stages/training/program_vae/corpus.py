"""Prepare the programs of a category as arrays of lines."""

from __future__ import annotations

import numpy as np

from pipeline.errors import Rejected
from pipeline.stage import Outcome, Task
from stages.shapeassembly.editing.ablations import without_alignment, without_macros, without_order
from stages.shapeassembly.editing.flattening import without_hierarchy
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.corpus import prepare_category
from stages.training.program_vae.batches import ProgramCorpus
from stages.training.program_vae.lines import AssemblyLines, assembly_lines
from stages.training.program_vae.settings import Ablation


def prepare(task: Task) -> Outcome:
    """Prepare the `ProgramCorpus` of train and val.

    Leaves out programs that 63 numbers a line cannot represent, and those of more than `max_length` lines.
    """
    ablation, max_lines = task.shard.params.get("ablate", "nothing"), task.shard.params["max_length"]

    def convert(key: str, program: AssemblyProgram) -> list[AssemblyLines]:
        assemblies = assembly_lines(ablate_program(program, ablation, task.rng("order", key)))
        if sum(len(assembly.numbers) for assembly in assemblies) > max_lines:
            raise Rejected("longer than training.max_length")
        return assemblies

    def count(programs: ProgramCorpus) -> dict[str, int]:
        return {"programs": len(programs), "assemblies": len(programs.boxes), "lines": len(programs.lines)}

    return prepare_category(task, convert, ProgramCorpus.of, count, f"programs of at most {max_lines} lines")


def ablate_program(program: AssemblyProgram, ablation: Ablation, rng: np.random.Generator) -> AssemblyProgram:
    """Rewrite a program without a part of the language. Raises ProgramError and Rejected where that is impossible."""
    if ablation == "hierarchy":
        return without_hierarchy(program)
    if ablation == "macros":
        return without_macros(program)
    if ablation == "order":
        return without_order(program, rng)
    return without_alignment(program) if ablation == "align" else program
