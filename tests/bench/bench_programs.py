"""Programs: shapes a second and core, beside what an asset takes in a public generator."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from stages.programs.draws import Share
from stages.programs.parameters import Value
from stages.programs.program import Program, build_shape, find_program, program_names
from stages.programs.sampling import Sampler, ValueIndex, all_value_indices
from tests.bench.measure import Measure, rate

SHAPES = 50
INFINIGEN = 1 / 0.36
"""Chairs a second of Infinigen's chair factory on a core like ours, as measured beside this project."""


def bench() -> Iterator[Measure]:
    """Random shapes of each program as triangles; then samples of the protocol, each checked for effect."""
    for name in program_names():
        program = find_program(name)
        sampler, rng = Sampler(program, Share(), off_grid=False), np.random.default_rng(1)
        shapes = [sampler.find(None, rng) for _ in range(SHAPES)]

        def build(program: Program = program, shapes: list[dict[str, Value]] = shapes) -> int:
            return sum(1 for values in shapes if len(build_shape(program, values)))

        peer, theirs = ("Infinigen chair factory", INFINIGEN) if name == "chair" else ("", None)
        yield Measure(f"programs, {name}", "shapes", rate(build), peer, theirs, f"{SHAPES} random shapes, triangulated")
        every = itertools.cycle(all_value_indices(program))

        def sample(
            sampler: Sampler = sampler, every: Iterator[ValueIndex] = every, rng: np.random.Generator = rng
        ) -> int:
            sampler.find(next(every), rng)
            return 1

        yield Measure(
            f"programs, {name}, sampled", "samples", rate(sample), note="valid, visible, effective, not alike"
        )
