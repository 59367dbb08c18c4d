"""Shape programs: a pure function from parameters to the parts of a shape, with its schema as data (geocode §3)."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config import nearest_word
from pipeline.errors import ConfigError
from stages.programs.conditions import Condition
from stages.programs.curves.part import Part
from stages.programs.parameters import Parameter
from stages.programs.schema import Schema, Values
from stages.shape.kit import Assembly
from stages.shape.shape import Shape


class BuildError(ValueError):
    """A program fails at values that keep its constraints."""


@dataclass(frozen=True)
class Constraint:
    """A condition of every valid shape. It applies while all of its parameters are visible.

    name: rejected shapes are counted by it
    condition: over parameters
    description: the reason, for people
    """

    name: str
    condition: Condition
    description: str


@dataclass(frozen=True)
class Program:
    """One program, `PROGRAM = Program(...)` in a file of its own: `stages/programs/library/<name>.py`.

    name: the file's name
    description: what it makes
    labels: the part labels, in a fixed order; every part that `build` returns has one of them
    build: from canonical, valid values to parts in world coordinates, y up, front at +z; without randomness or state
    constraints: which combinations of values are valid
    non_intersecting: pairs of labels whose parts may not intersect; samples in which they do are rejected (geocode
    §3.1)
    view_elevation: of pictures, in degrees above the horizon; negative for shapes that hang from a ceiling
    """

    name: str
    description: str
    parameters: tuple[Parameter, ...]
    labels: tuple[str, ...]
    build: Callable[[Values], Sequence[Part]]
    constraints: tuple[Constraint, ...] = ()
    non_intersecting: tuple[tuple[str, str], ...] = ()
    view_elevation: float = 25.0

    def __post_init__(self) -> None:
        for constraint in self.constraints:
            for name in constraint.condition.names:
                if name not in self.schema.by_name:
                    raise ValueError(f"constraint {constraint.name} uses {name}, which is no parameter")
        for label in (label for pair in self.non_intersecting for label in pair):
            if label not in self.labels:
                labels = ", ".join(self.labels)
                raise ValueError(f"{self.name}: non_intersecting has {label!r}, which is no label; labels are {labels}")

    @cached_property
    def schema(self) -> Schema:
        """The schema of the parameters."""
        return Schema(self.parameters)

    def violated(self, values: Values) -> tuple[Constraint, ...]:
        """The constraints that `values` violate."""
        canonical, visible = self.schema.canonical(values)
        return tuple(
            constraint
            for constraint in self.constraints
            if visible.issuperset(constraint.condition.names) and not constraint.condition.holds(canonical)
        )

    def parts(self, values: Values) -> Sequence[Part]:
        """Build the parts at `values`. Raises BuildError with the values where `build` raises anything."""
        canonical, _ = self.schema.canonical(values)
        try:
            return self.build(canonical)
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise BuildError(f"program {self.name} fails at {self.schema.to_text(canonical)}: {reason}") from error


def build_shape(program: Program, values: Values) -> Shape:
    """Build the shape at `values`: one mesh per part, y up, without contacts."""
    return shape_from_parts(program, program.parts(values))


def shape_from_parts(program: Program, parts: Sequence[Part]) -> Shape:
    """Make a shape of parts that `program` has built.

    The origin of each mesh is the middle of its bounding box. Poses only translate.
    """
    placed = [part.part_mesh() for part in parts]
    poses = np.tile(np.eye(4), (len(placed), 1, 1))
    poses[:, :3, 3] = [mesh.bounds.mean(axis=0) for mesh in placed]
    centred = zip(placed, poses[:, :3, 3], strict=True)
    meshes = tuple(replace(mesh, vertices=mesh.vertices - centre) for mesh, centre in centred)
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, np.empty((0, 2), np.int32))
    joints = tuple(part.joint for part in parts) if any(part.joint for part in parts) else ()
    return Shape(meshes=meshes, assembly=assembly, up="y", labels=program.labels, part_joints=joints)


def shape_from_text(program: str, text: str) -> Shape:
    """Build the shape of a sample from its text, by the program named `program`.

    Raises ConfigError for an unknown program, ParameterError for a text that does not fit it.
    """
    found = find_program(program)
    return build_shape(found, found.schema.from_text(text))


def program_names() -> tuple[str, ...]:
    """Names of the programs of the library: files with PROGRAM at the start of a line. Nothing is imported."""
    folder = Path(__file__).parent / "library"
    return tuple(
        path.stem
        for path in sorted(folder.glob("*.py"))
        if re.search(r"(?m)^PROGRAM\b", path.read_text(encoding="utf-8"))
    )


def find_program(name: str) -> Program:
    """Find a program by its name, or by its dotted module. Raises ConfigError for an unknown one."""
    module = program_module(name)
    try:
        found: Any = getattr(importlib.import_module(module), "PROGRAM", None)
    except ModuleNotFoundError as error:
        raise ConfigError(f"program {name!r}: {error}") from error
    if not isinstance(found, Program):
        raise ConfigError(f"program {name!r}: {module} must hold PROGRAM = Program(...)")
    return found


def program_module(name: str) -> str:
    """The module where `find_program` finds a program. Raises ConfigError for a name of neither program nor module."""
    names = program_names()
    if name in names:
        return f"{__package__}.library.{name}"
    if "." in name and all(word.isidentifier() for word in name.split(".")):
        return name
    close = nearest_word(name, names)
    hint = f"did you mean {close}?" if close else f"programs are {', '.join(names) or 'none'}"
    raise ConfigError(f"there is no program {name[:1000]!r}; {hint}")
