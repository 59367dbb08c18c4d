"""ShapeAssembly programs per second, compared with the published rate of their authors' interpreter.

With the published programs next to the project: 1,000 of each category; without: the twelve shipped ones. The authors'
interpreter executes 53 to 78 programs per second on one thread of a machine with two cores; the higher rate is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import torch

from stages.shapeassembly import execute, execute_all, parse
from stages.shapeassembly.execution.differentiable import DifferentiableProgram
from stages.shapeassembly.execution.parameters import parameters
from stages.shapeassembly.sources import program_texts
from stages.shapeassembly.syntax.program import AssemblyProgram
from tests.bench.measure import Measure, rate

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "shapeassembly" / "programs.tar.xz"
PUBLISHED_NAME, PUBLISHED_RATE = "their authors', as stated", 78.0
MAX_PROGRAMS = 1000


def category_texts() -> dict[str, list[str]]:
    """Return the texts of the published programs by category, at most MAX_PROGRAMS, or of the shipped ones."""
    if not SHARED.is_file():
        return {"shipped": [text for _, text in program_texts(ROOT / "datasets" / "exemplars" / "programs")]}
    categories = ("chair", "table", "storage")
    return {name: [text for _, text in program_texts(SHARED, f"data/{name}")][:MAX_PROGRAMS] for name in categories}


def _differentiate(programs: list[AssemblyProgram]) -> int:
    for program in programs:
        values = torch.tensor(parameters(program), requires_grad=True)
        DifferentiableProgram(program).corners(values).sum().backward()  # type: ignore[no-untyped-call]
    return len(programs)


def bench() -> Iterator[Measure]:
    """Programs per second and core: parsed, executed one by one and together, differentiated."""
    torch.set_num_threads(1)
    for category, texts in category_texts().items():
        programs = [parse(text) for text in texts]
        few = programs[:50]
        for name, work, peer in [
            ("read", lambda texts=texts: len([parse(text) for text in texts]), None),
            (
                "executed one by one",
                lambda programs=programs: len([execute(program) for program in programs]),
                PUBLISHED_RATE,
            ),
            ("executed together", lambda programs=programs: len(execute_all(programs)), PUBLISHED_RATE),
            ("forward and backward", lambda few=few: _differentiate(few), None),
        ]:
            ours = rate(work, seconds=0.7, rounds=2)
            yield Measure(f"{category} programs {name}", "programs", ours, PUBLISHED_NAME if peer else "", peer)
