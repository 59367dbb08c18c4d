"""A program: a pure function from parameters to the parts of a shape, with its schema as data (geocode §3)."""

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
    """A rule that every valid shape keeps. It binds only while all parameters it speaks of are visible.

    name: what rejects are counted by; rule: over parameters; sentence: why, for people.
    """

    name: str
    condition: Condition
    description: str


@dataclass(frozen=True)
class Program:
    """One program. `PROGRAM = Program(...)` stands in a file of its own, `stages/programs/library/<name>.py`.

    name: the file's name; sentence: what it makes.
    labels: the part labels, in a fixed order; every part that `build` returns has one of them.
    build: settled values (hidden parameters stand at their base) -> parts in world coordinates, y up, front at +z;
    pure: no randomness, no state. It is called with valid values only.
    constraints: which combinations of values are valid.
    apart: pairs of labels whose parts may not intersect; samples in which they do are refused (geocode §3.1).
    elevation: from how high pictures look at it, in degrees above the horizon; below it what hangs from a ceiling.
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
                    raise ValueError(f"constraint {constraint.name} speaks of {name}, which is not there")
        for label in (each for pair in self.non_intersecting for each in pair):
            if label not in self.labels:
                raise ValueError(f"{self.name}: parts {label!r} shall stay apart; labels are {', '.join(self.labels)}")

    @cached_property
    def schema(self) -> Schema:
        """The parameters together."""
        return Schema(self.parameters)

    def violated(self, values: Values) -> tuple[Constraint, ...]:
        """The constraints that `values` break."""
        settled, visible = self.schema.canonical(values)
        return tuple(
            each
            for each in self.constraints
            if visible.issuperset(each.condition.names) and not each.condition.holds(settled)
        )

    def parts(self, values: Values) -> Sequence[Part]:
        """The parts at `values`; hidden parameters have no say.

        Raises BuildError where `build` raises anything, and says at which values.
        """
        settled, _ = self.schema.canonical(values)
        try:
            return self.build(settled)
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            raise BuildError(f"program {self.name} fails at {self.schema.to_text(settled)}: {why}") from error


def build_shape(program: Program, values: Values) -> Shape:
    """The shape at `values`: one mesh a part, y up, without contacts."""
    return shape_from_parts(program, program.parts(values))


def shape_from_parts(program: Program, parts: Sequence[Part]) -> Shape:
    """The shape of parts that `program` has made. The origin of each mesh is the middle of the box around it, and the
    pose says where that is in the world; it turns nothing."""
    placed = [part.part_mesh() for part in parts]
    poses = np.tile(np.eye(4), (len(placed), 1, 1))
    poses[:, :3, 3] = [mesh.bounds.mean(axis=0) for mesh in placed]
    centred = zip(placed, poses[:, :3, 3], strict=True)
    meshes = tuple(replace(mesh, vertices=mesh.vertices - centre) for mesh, centre in centred)
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, np.empty((0, 2), np.int32))
    return Shape(meshes=meshes, assembly=assembly, up="y", labels=program.labels)


def shape_from_text(program: str, text: str) -> Shape:
    """The shape that a sample's text says, of the program called `program`. Raises ConfigError for a program that is
    not there, ParameterError for a text that is none of its own."""
    found = find_program(program)
    return build_shape(found, found.schema.from_text(text))


def program_names() -> tuple[str, ...]:
    """The programs of the library: every file that says PROGRAM at the start of a line. None is imported."""
    folder = Path(__file__).parent / "library"
    return tuple(path.stem for path in sorted(folder.glob("*.py")) if re.search(r"(?m)^PROGRAM\b", path.read_text()))


def find_program(name: str) -> Program:
    """The program of a name, or, for a name with a dot, the one in the module of that name.

    Raises ConfigError if there is none.
    """
    module = program_module(name)
    try:
        found: Any = getattr(importlib.import_module(module), "PROGRAM", None)
    except ModuleNotFoundError as error:
        raise ConfigError(f"program {name!r}: {error}") from error
    if not isinstance(found, Program):
        raise ConfigError(f"program {name!r}: {module} must hold PROGRAM = Program(...)")
    return found


def program_module(name: str) -> str:
    """The module in which `find_program` finds a program. Raises ConfigError for what names neither a program of the
    library nor a module."""
    names = program_names()
    if name in names:
        return f"{__package__}.library.{name}"
    if "." in name and all(step.isidentifier() for step in name.split(".")):
        return name
    close = nearest_word(name, names)
    hint = f"did you mean {close}?" if close else f"programs are {', '.join(names) or 'none'}"
    raise ConfigError(f"there is no program {name[:1000]!r}; {hint}")
