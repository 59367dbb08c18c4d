"""Programs: shapes per second and core, compared with a public generator of assets."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from stages.programs.draws import Share
from stages.programs.parameters import Value
from stages.programs.program import Program, build_shape, find_program, program_names
from stages.programs.sampling import Sampler, ValueIndex, all_value_indices
from tests.bench.measure import Measure, rate

SHAPES_PER_PROGRAM = 50
INFINIGEN_RATE = 1 / 0.36
"""Chairs per second of Infinigen's chair factory on the same kind of core."""


def bench() -> Iterator[Measure]:
    """Random shapes of each program as triangles; then samples of the protocol, checked for effect."""
    for name in program_names():
        program = find_program(name)
        sampler, rng = Sampler(program, Share(), off_grid=False), np.random.default_rng(1)
        shapes = [sampler.find(None, rng) for _ in range(SHAPES_PER_PROGRAM)]

        def build(program: Program = program, shapes: list[dict[str, Value]] = shapes) -> int:
            return sum(1 for values in shapes if len(build_shape(program, values)))

        peer, theirs = ("Infinigen chair factory", INFINIGEN_RATE) if name == "chair" else ("", None)
        yield Measure(
            f"programs, {name}",
            "shapes",
            rate(build),
            peer,
            theirs,
            f"{SHAPES_PER_PROGRAM} random shapes, triangulated",
        )
        every = itertools.cycle(all_value_indices(program))

        def sample(
            sampler: Sampler = sampler, every: Iterator[ValueIndex] = every, rng: np.random.Generator = rng
        ) -> int:
            sampler.find(next(every), rng)
            return 1

        yield Measure(
            f"programs, {name}, sampled", "samples", rate(sample), note="valid, visible, effective, not alike"
        )
