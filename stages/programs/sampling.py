"""The sampling protocol (geocode §4): valid random shapes, each with one parameter that is seen and takes effect."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import ShardFailed
from stages.programs.draws import Share, draw
from stages.programs.effect import has_effect
from stages.programs.intersection import intersecting_labels
from stages.programs.parameters import Value
from stages.programs.program import BuildError, Program, shape_from_parts
from stages.shape.arrays import FloatArray
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements

MAX_DRAWS_PER_SHAPE = 2000
"""So many draws of a shard's own are tried for one shape."""
MIN_DRAWS_PER_BATCH, MAX_DRAWS_PER_BATCH = 32, 8192
"""Draws at a time."""

ValueIndex = tuple[str, int]
"""A parameter and the index of one of its values."""


def all_value_indices(program: Program) -> list[ValueIndex]:
    """Every value of every parameter, in order."""
    return [(each.name, index) for each in program.parameters for index in range(len(each.values))]


def structure_digest(program: Program, values: dict[str, Value]) -> str:
    """Hex sha256 of what is visible of the discrete and binary parameters: equal for shapes that differ by visible
    continuous values alone."""
    settled, visible = program.schema.canonical(values)
    seen = [
        f"{name}={settled[name]}"
        for name, each in program.schema.by_name.items()
        if each.kind != "continuous" and name in visible
    ]
    return hashlib.sha256("\n".join([program.name, *seen]).encode()).hexdigest()


class NoMoreShapes(ShardFailed):
    """There is no other shape in a share, or none that enough tries would find."""


@dataclass
class Sampler:
    """Finds shapes within one share, no two alike.

    off_grid: whether continuous parameters may have any value of their range; require: what shapes must be physically.
    refused: how many draws were refused, by cell's parameter (or `any`) and reason; tried: how many were looked at;
    failure: the last error of the program itself, where its `build` failed.
    """

    program: Program
    share: Share
    off_grid: bool
    require: Requirements = field(default_factory=Requirements)
    refused: Counter[tuple[str, str]] = field(default_factory=Counter)
    tried: int = 0
    failure: str = ""
    _known: set[str] = field(default_factory=set)

    def find(self, cell: ValueIndex | None, rng: np.random.Generator) -> dict[str, Value]:
        """Settled values of a new shape that keeps every constraint, whose parts stay apart where they should, and in
        which the parameter of `cell` has its value, is visible and takes effect.

        Raises NoMoreShapes where none is found, with what the draws were refused for.
        """
        schema = self.program.schema
        fixed = None if cell is None else (cell[0], float(schema.by_name[cell[0]].values[cell[1]]))
        item = "any" if cell is None else cell[0]
        before, first = self.refused.copy(), self.tried
        count = int(np.clip(3 / self.share.size, MIN_DRAWS_PER_BATCH, MAX_DRAWS_PER_BATCH))
        for _ in range(1 + round(MAX_DRAWS_PER_SHAPE / self.share.size / count)):
            draws = draw(schema, count, rng, self.off_grid, fixed)
            for column in draws.owned(self.share).tolist():
                self.tried += 1
                if fixed is not None and not draws.visible[list(schema.by_name).index(item), column]:
                    self.refused[item, "hidden"] += 1
                    continue
                values = schema.from_vector(draws.columns[:, column])
                if self._accepts(values, cell):
                    return values
        value = "" if fixed is None else f" with {item} = {fixed[1]:g}"
        why = _reasons(self.refused - before, self.failure) or "none of this shard"
        raise NoMoreShapes(
            f"{self.program.name}: no shape{value} in {self.tried - first} tries ({why}); "
            "ask for fewer shapes or shards, or look at the program's constraints"
        )

    def listed(self, shapes: FloatArray) -> Iterator[dict[str, Value]]:
        """The settled values of those of `shapes` (parameters, n) that `find` could find."""
        for column in shapes.T:
            self.tried += 1
            values = self.program.schema.from_vector(column)
            if self._accepts(values, None):
                yield values

    def reasons(self) -> str:
        """What was refused and why, in words."""
        return _reasons(self.refused, self.failure)

    def _accepts(self, values: dict[str, Value], cell: ValueIndex | None) -> bool:
        reason = self._refusal(values, cell)
        if reason is not None:
            self.refused["any" if cell is None else cell[0], reason] += 1
        return reason is None

    def _refusal(self, values: dict[str, Value], cell: ValueIndex | None) -> str | None:
        """Why `values` make no sample, or None; what is cheap to ask is asked first."""
        broken = self.program.violated(values)
        if broken:
            return f"breaks {broken[0].name}"
        text = self.program.schema.to_text(values)
        if text in self._known:
            return "alike"
        try:
            parts = self.program.parts(values)
            if cell is not None and not has_effect(self.program, values, cell[0], parts):
                return "no effect"
        except BuildError as error:
            self.failure = str(error)
            return "fails"
        met = intersecting_labels(self.program, parts)
        if met is not None:
            return f"{met[0]} meets {met[1]}"
        weak = unmet_requirement(self.require, shape_from_parts(self.program, parts))
        if weak is not None:
            return weak
        self._known.add(text)
        return None


def _reasons(refused: Counter[tuple[str, str]], failure: str) -> str:
    told = ", ".join(f"{count} {reason}" for (_, reason), count in sorted(refused.items()))
    return f"{told}; {failure}" if failure else told
