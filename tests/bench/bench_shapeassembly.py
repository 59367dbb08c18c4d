"""ShapeAssembly programs a second, beside the rate that is stated for their authors' interpreter.

With the published programs beside the project: 1,000 of each category; without: the twelve that we ship. The authors'
interpreter executes 53 to 78 programs a second on one thread of a machine with two cores; the higher rate stands here.
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
AUTHORS, STATED = "their authors', as stated", 78.0
EACH = 1000


def category_texts() -> dict[str, list[str]]:
    """The texts of the published programs of each category, at most EACH, or of those that we ship."""
    if not SHARED.is_file():
        return {"shipped": [text for _, text in program_texts(ROOT / "datasets" / "exemplars" / "programs")]}
    categories = ("chair", "table", "storage")
    return {each: [text for _, text in program_texts(SHARED, f"data/{each}")][:EACH] for each in categories}


def _differentiate(programs: list[AssemblyProgram]) -> int:
    for program in programs:
        values = torch.tensor(parameters(program), requires_grad=True)
        DifferentiableProgram(program).corners(values).sum().backward()  # type: ignore[no-untyped-call]
    return len(programs)


def bench() -> Iterator[Measure]:
    """Programs a second and core: read, executed one by one and together, differentiated."""
    torch.set_num_threads(1)
    for category, texts in category_texts().items():
        programs = [parse(text) for text in texts]
        few = programs[:50]
        for name, work, peer in [
            ("read", lambda texts=texts: len([parse(text) for text in texts]), None),
            ("executed one by one", lambda programs=programs: len([execute(each) for each in programs]), STATED),
            ("executed together", lambda programs=programs: len(execute_all(programs)), STATED),
            ("forward and backward", lambda few=few: _differentiate(few), None),
        ]:
            ours = rate(work, seconds=0.7, rounds=2)
            yield Measure(f"{category} programs {name}", "programs", ours, AUTHORS if peer else "", peer)
