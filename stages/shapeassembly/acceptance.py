"""Which programs become samples: those that pass every check, and edits of them that do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from pipeline.errors import Rejected
from pipeline.stage import Task
from stages.shape.physics.judge import unmet_requirement
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.editing.edits import edited
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
"""Edits of a program that are tried for one that passes."""


def accepted_rows(task: Task, config: ShapeAssemblyConfig, refused: Counter[str]) -> Iterator[dict[str, Any]]:
    """The programs that become samples, each followed by its edits; the others are refused, and counted in `refused`.

    A row has `key`, `kit`, `file` (its name in its source; of an edit, that of the program), `method`, `text`
    (canonical), `graph` (its signature), `parts` (leaf cuboids) and `labels` (theirs, a set).
    """
    known: set[str] = set()
    places: Counter[str] = Counter()
    edits = {source.name: (source.edits, source.spread) for source in config.programs}

    def accepted(kind: str, name: str, text: str, method: str) -> dict[str, Any]:
        row = _row(text, config)
        if row["text"] in known:
            raise Rejected("program is there already", name)
        known.add(row["text"])
        places[kind] += 1
        return {"key": f"{kind}-{places[kind] - 1:06d}", "kit": kind, "file": name, "method": method, **row}

    texts = list(_texts(task, config))
    for place, (kind, name, text) in enumerate(texts):
        task.progress(place, len(texts))
        try:
            row = accepted(kind, name, text, "executed")
        except (ProgramError, Rejected) as error:
            detail = str(error) if isinstance(error, ProgramError) else error.detail
            task.reject(f"{kind}/{name}", error.reason, detail)
            refused[error.reason] += 1
            continue
        yield row
        count, spread = edits.get(kind, (0, 0.0))
        for number in range(count):
            rng = task.rng("edit", kind, name, number)
            for _ in range(MAX_EDIT_TRIES):
                try:
                    yield accepted(kind, name, print_program(edited(parse(row["text"]), spread, rng)), "edited")
                    break
                except (ProgramError, Rejected):
                    continue
            else:
                task.reject(f"{kind}/{name}", "no edit passed", f"in {MAX_EDIT_TRIES} tries; a smaller spread may help")


def _texts(task: Task, config: ShapeAssemblyConfig) -> Iterator[tuple[str, str, str]]:
    """Of each program the name of its source, its own name there, and its text: those read, those extracted, and those
    that models have written."""
    for source in config.programs:
        for name, text in program_texts(source.path, source.folder):
            if name not in source.lists.values():
                yield source.name, name, text
    for each in read_program_texts(task):
        yield each.kind, each.name, each.text


def _row(text: str, config: ShapeAssemblyConfig) -> dict[str, Any]:
    """What there is to say of one program. Raises ProgramError or Rejected where it does not pass."""
    program = parse(text)
    execution = execute(program)
    if not config.min_parts <= len(execution) <= config.max_parts:
        raise Rejected("number of parts", f"{len(execution)} leaf cuboids")
    beyond = overflow(program, execution)
    if beyond > config.overflow:
        raise Rejected("reaches out of the bounding box", f"by {100 * beyond:.1f} % of its size")
    if config.accept == "valid":
        broken = violations(program)
        if broken:
            raise Rejected(broken[0].rule, str(broken[0]))
        for block in program.blocks:
            for name in protruding_parts(block):
                raise Rejected("reaches out of its assembly", f"{name} of {block.name}")
    weak = unmet_requirement(config.require, shape_of_execution(execution))
    if weak is not None:
        raise Rejected(weak)
    return {
        "text": print_program(program),
        "graph": signature(program),
        "parts": len(execution),
        "labels": set(execution.labels),
    }
