"""The sampling protocol (geocode §4): valid random shapes, each with one visible parameter that takes effect."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import ShardFailed
from stages.programs.curves.part import Part
from stages.programs.draws import Share, draw
from stages.programs.intersection import intersecting_labels
from stages.programs.parameters import Value
from stages.programs.program import BuildError, Program, shape_from_parts
from stages.programs.repair import repair
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray
from stages.shape.physics.settings import Requirements

MAX_DRAWS_PER_SHAPE = 2000
"""Of the shard's own share."""
MIN_DRAWS_PER_BATCH, MAX_DRAWS_PER_BATCH = 32, 8192

ValueIndex = tuple[str, int]
"""A parameter and the index of one of its values."""

MAX_SAME_POSITION_DISTANCE = 1e-6
"""In the program's units."""


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
        from stages.shape.physics.judge import unmet_requirement

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


def has_effect(program: Program, values: Values, name: str, parts: Sequence[Part]) -> bool:
    """Whether a shape changes with parameter `name` alone, both to its next lower and to its next higher valid value.

    values: valid and canonical, of the shape made of `parts`. Parameters that come into view may change to satisfy the
    constraints. A parameter without another valid value has no effect.
    """
    parameter = program.schema.by_name[name]
    _, visible = program.schema.canonical(values)
    index = parameter.class_of(values[name])
    tried = False
    for others in (parameter.values[:index][::-1], parameter.values[index + 1 :]):
        for other in others:
            changed = repair(program, {**values, name: other}, visible)
            if changed is not None:
                if same_geometry(parts, program.parts(changed)):
                    return False
                tried = True
                break
    return tried


def same_geometry(parts: Sequence[Part], others: Sequence[Part]) -> bool:
    """Whether two shapes have the same parts in the same order and positions."""
    return len(parts) == len(others) and all(
        a.label == b.label
        and a.mesh.vertices.shape == b.mesh.vertices.shape
        and a.mesh.quads.shape == b.mesh.quads.shape
        and bool(np.abs(a.mesh.vertices - b.mesh.vertices).max(initial=0.0) <= MAX_SAME_POSITION_DISTANCE)
        for a, b in zip(parts, others, strict=True)
    )
