"""The sampling protocol (geocode §4): valid random shapes, each with one visible parameter that takes effect."""

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
"""Of the shard's own share."""
MIN_DRAWS_PER_BATCH, MAX_DRAWS_PER_BATCH = 32, 8192

ValueIndex = tuple[str, int]
"""A parameter and the index of one of its values."""


def all_value_indices(program: Program) -> list[ValueIndex]:
    """List every value of every parameter, in order."""
    return [(parameter.name, index) for parameter in program.parameters for index in range(len(parameter.values))]


def structure_digest(program: Program, values: dict[str, Value]) -> str:
    """Hex sha256 of the visible discrete and binary values: equal for shapes that differ in continuous values alone."""
    canonical, visible = program.schema.canonical(values)
    structure = [
        f"{name}={canonical[name]}"
        for name, parameter in program.schema.by_name.items()
        if parameter.kind != "continuous" and name in visible
    ]
    return hashlib.sha256("\n".join([program.name, *structure]).encode()).hexdigest()


class NoMoreShapes(ShardFailed):
    """A share has no further shape, or none is found with enough draws."""


@dataclass
class Sampler:
    """Finds shapes within one share, without duplicates.

    off_grid: whether continuous parameters may have any value of their range
    require: physical requirements
    refused: number of refused draws, by fixed parameter (or `any`) and reason
    tried: number of draws examined
    failure: the last error of the program's `build`
    """

    program: Program
    share: Share
    off_grid: bool
    require: Requirements = field(default_factory=Requirements)
    refused: Counter[tuple[str, str]] = field(default_factory=Counter)
    tried: int = 0
    failure: str = ""
    _known: set[str] = field(default_factory=set)

    def find(self, value_index: ValueIndex | None, rng: np.random.Generator) -> dict[str, Value]:
        """Find canonical values of a new valid shape.

        With a `value_index`, that parameter has that value, is visible and takes effect. Raises NoMoreShapes with the
        reasons why draws were refused.
        """
        schema = self.program.schema
        item, fixed = "any", None
        if value_index is not None:
            item = value_index[0]
            fixed = item, float(schema.by_name[item].values[value_index[1]])
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
                if self._accepts(values, value_index):
                    return values
        value = f" with {item} = {fixed[1]:g}" if fixed else ""
        reasons = _reasons(self.refused - before, self.failure) or "none of this shard"
        raise NoMoreShapes(
            f"{self.program.name}: no shape{value} in {self.tried - first} tries ({reasons}); "
            "ask for fewer shapes or shards, or relax the program's constraints"
        )

    def listed(self, shapes: FloatArray) -> Iterator[dict[str, Value]]:
        """Yield the canonical values of those `shapes` (parameters, n) that `find` would accept."""
        for column in shapes.T:
            self.tried += 1
            values = self.program.schema.from_vector(column)
            if self._accepts(values, None):
                yield values

    def reasons(self) -> str:
        """The reasons for refused draws, in words."""
        return _reasons(self.refused, self.failure)

    def _accepts(self, values: dict[str, Value], value_index: ValueIndex | None) -> bool:
        name = None if value_index is None else value_index[0]
        reason = self._refusal(values, name)
        if reason is not None:
            self.refused[name or "any", reason] += 1
        return reason is None

    def _refusal(self, values: dict[str, Value], fixed: str | None) -> str | None:
        """Why `values` make no sample, or None; cheap tests first. fixed: a parameter that must take effect."""
        violated = self.program.violated(values)
        if violated:
            return f"violates {violated[0].name}"
        text = self.program.schema.to_text(values)
        if text in self._known:
            return "duplicate"
        try:
            parts = self.program.parts(values)
            if fixed is not None and not has_effect(self.program, values, fixed, parts):
                return "no effect"
        except BuildError as error:
            self.failure = str(error)
            return "build fails"
        labels = intersecting_labels(self.program, parts)
        if labels is not None:
            return f"{labels[0]} intersects {labels[1]}"
        requirement = unmet_requirement(self.require, shape_from_parts(self.program, parts))
        if requirement is not None:
            return requirement
        self._known.add(text)
        return None


def _reasons(refused: Counter[tuple[str, str]], failure: str) -> str:
    counts = ", ".join(f"{count} {reason}" for (_, reason), count in sorted(refused.items()))
    return f"{counts}; {failure}" if failure else counts
