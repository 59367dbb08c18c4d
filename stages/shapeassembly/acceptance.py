"""Select the programs that become samples: those that pass every check, and edits of them that do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from pipeline.errors import Rejected
from pipeline.stage import Task
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.editing.edits import edit_program
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.extraction.shards import read_program_texts
from stages.shapeassembly.settings import ShapeAssemblyConfig
from stages.shapeassembly.shape import shape_of_execution
from stages.shapeassembly.sources import program_texts
from stages.shapeassembly.syntax.checks import overflow, protruding_parts, violations
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.parser import parse
from stages.shapeassembly.syntax.printer import print_program

MAX_EDIT_TRIES = 8


def accepted_rows(task: Task, config: ShapeAssemblyConfig, rejected: Counter[str]) -> Iterator[dict[str, Any]]:
    """Yield the programs that become samples, each followed by its edits.

    A row has `key`, `kit`, `file` (name in its source; of an edit, that of the program), `method`, `text` (canonical),
    `graph` (signature), `parts` (leaf cuboids) and `labels` (of the leaves, a set).
    rejected: counts the other programs by reason.
    """
    texts_seen: set[str] = set()
    counts: Counter[str] = Counter()
    edits = {source.name: (source.edits, source.log_std) for source in config.programs}

    def accepted(kit: str, name: str, text: str, method: str) -> dict[str, Any]:
        row = _row(text, config)
        if row["text"] in texts_seen:
            raise Rejected("duplicate program", name)
        texts_seen.add(row["text"])
        counts[kit] += 1
        return {"key": f"{kit}-{counts[kit] - 1:06d}", "kit": kit, "file": name, "method": method, **row}

    programs = list(_texts(task, config))
    for done, (kit, name, text) in enumerate(programs):
        task.progress(done, len(programs))
        try:
            row = accepted(kit, name, text, "executed")
        except (ProgramError, Rejected) as error:
            detail = str(error) if isinstance(error, ProgramError) else error.detail
            task.reject(f"{kit}/{name}", error.reason, detail)
            rejected[error.reason] += 1
            continue
        yield row
        count, log_std = edits.get(kit, (0, 0.0))
        for number in range(count):
            rng = task.rng("edit", kit, name, number)
            for _ in range(MAX_EDIT_TRIES):
                try:
                    yield accepted(kit, name, print_program(edit_program(parse(row["text"]), log_std, rng)), "edited")
                    break
                except (ProgramError, Rejected):
                    continue
            else:
                task.reject(f"{kit}/{name}", "no edit passed", f"in {MAX_EDIT_TRIES} tries; a smaller log_std may help")


def _texts(task: Task, config: ShapeAssemblyConfig) -> Iterator[tuple[str, str, str]]:
    """Yield kit, name and text of each program: read, extracted, drawn at random, or sampled from a model."""
    for source in config.programs:
        for name, text in program_texts(source.path, source.folder):
            if name not in source.lists.values():
                yield source.name, name, text
    for program in read_program_texts(task):
        yield program.kit, program.name, program.text


def accepted_text(text: str, config: ShapeAssemblyConfig, require: Requirements) -> str:
    """Return the canonical text of a program. Raises ProgramError or Rejected where it does not pass.

    require: physical requirements in place of the config's
    """
    accepted: str = _row(text, config.model_copy(update={"require": require}))["text"]
    return accepted


def _row(text: str, config: ShapeAssemblyConfig) -> dict[str, Any]:
    """Return the row of one program. Raises ProgramError or Rejected where it does not pass."""
    program = parse(text)
    execution = execute(program)
    if not config.min_parts <= len(execution) <= config.max_parts:
        raise Rejected("number of parts", f"{len(execution)} leaf cuboids")
    excess = overflow(program, execution)
    if excess > config.max_overflow:
        raise Rejected("reaches out of the bounding box", f"by {100 * excess:.1f} % of its size")
    if config.accept == "valid":
        broken = violations(program)
        if broken:
            raise Rejected(broken[0].rule, str(broken[0]))
        for block in program.blocks:
            for name in protruding_parts(block):
                raise Rejected("reaches out of its assembly", f"{name} of {block.name}")
    missing = unmet_requirement(config.require, shape_of_execution(execution))
    if missing is not None:
        raise Rejected(missing)
    return {
        "text": print_program(program),
        "graph": signature(program),
        "parts": len(execution),
        "labels": set(execution.labels),
    }
