"""How far each parameter moves the surface: what can be told from a cloud or a drawing, and what cannot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np

from stages.points.area_sampling import sample_surface
from stages.programs.curves import QuadMesh
from stages.programs.draws import Share
from stages.programs.parameters import Parameter, Value
from stages.programs.program import BuildError, Program
from stages.programs.sampling import NoMoreShapes, Sampler
from stages.shape.arrays import FloatArray

MIN_RANGE_MOVEMENT, MIN_CLASS_MOVEMENT = 0.005, 0.0025
"""What is moved less by its whole range, and by one class, as shares of the diagonal, is hard to read."""

MAX_BASES_PER_SHAPE = 50
"""So many times as many shapes are drawn as shall show a parameter, and no more."""
SURFACE_SAMPLES = 4000
"""Points of each surface whose distance from the other is looked up, beside its vertices."""


@dataclass(frozen=True)
class Movement:
    """What one parameter does to base shapes in which it is visible, as shares of their diagonals.

    far, step: float64 (bases,), by how much its farthest other value and its next one move the surface: the greatest
    distance of a point of either surface from the other.
    """

    parameter: Parameter
    far: FloatArray
    step: FloatArray

    @property
    def seen(self) -> float:
        """The share of the base shapes whose surface its farthest value moves by more than FAINT."""
        return float((self.far > MIN_RANGE_MOVEMENT).mean())

    @property
    def weak(self) -> bool:
        """Whether a fifth of the base shapes or more do not show it, or half of them do not tell its classes apart."""
        return self.seen < 0.8 or float(np.median(self.step)) < MIN_CLASS_MOVEMENT


def movements(program: Program, count: int, seed: int) -> Iterator[Movement]:
    """What each parameter does to `count` random valid base shapes in which it is visible, or to all where there are
    fewer.

    Only values that alone keep every constraint are looked at. Raises ValueError for a parameter that no shape shows.
    """
    sampler, rng = Sampler(program, Share(), off_grid=False), np.random.default_rng(seed)
    known: list[_Base] = []
    for parameter in program.parameters:
        found: list[tuple[float, float]] = []
        for base in islice(_bases(known, sampler, rng), MAX_BASES_PER_SHAPE * count):
            found += base.moved_by(parameter)
            if len(found) == count:
                break
        if not found:
            raise ValueError(f"{program.name}: no shape shows another value of {parameter.name}")
        far, step = np.array(found).T
        yield Movement(parameter, far, step)


def surface_movements(
    program: Program, values: Mapping[str, Value], changes: Sequence[Mapping[str, Value]]
) -> FloatArray:
    """By how much each of some changes moves the surface of the shape at `values`: the greatest distance of a point of
    either surface from the other, as a share of the shape's diagonal, float64 (changes,).

    A change that breaks a constraint, or at which the program fails, moves it infinitely far."""
    own = _surface(program, values)
    found = []
    for change in changes:
        changed = {**values, **change}
        try:
            found.append(float("inf") if program.violated(changed) else own.apart(_surface(program, changed)))
        except BuildError:
            found.append(float("inf"))
    return np.array(found)


def movement_table(found: Sequence[Movement]) -> str:
    """The movements as a Markdown table, a line a parameter. Ends with a newline."""
    lines = [
        f"| parameter | shapes whose surface the far end of its range moves by more than {MIN_RANGE_MOVEMENT:.1%}"
        " | median, far end "
        "| median, next class | |",
        "|---|---:|---:|---:|---|",
    ]
    for each in found:
        far, step = (f"{np.median(share):.2%}" for share in (each.far, each.step))
        lines.append(f"| `{each.parameter.name}` | {each.seen:.0%} | {far} | {step} | {'weak' if each.weak else ''} |")
    return "\n".join(lines) + "\n"


def _bases(known: list[_Base], sampler: Sampler, rng: np.random.Generator) -> Iterator[_Base]:
    """The known ones first, then new ones, which are known from then on."""
    yield from tuple(known)
    while True:
        try:
            known.append(_Base(sampler.program, sampler.find(None, rng)))
        except NoMoreShapes:
            return
        yield known[-1]


@dataclass(frozen=True, eq=False)
class _Base:
    program: Program
    values: dict[str, Value]

    @cached_property
    def surface(self) -> _Surface:
        return _surface(self.program, self.values)

    def moved_by(self, parameter: Parameter) -> list[tuple[float, float]]:
        """By how much the farthest and the next other value move the surface; empty where there is none to see."""
        if parameter.name not in self.program.schema.canonical(self.values)[1]:
            return []
        own = float(self.values[parameter.name])
        changed = [{**self.values, parameter.name: value} for value in parameter.values if float(value) != own]
        others = sorted(
            (each for each in changed if not self.program.violated(each)),
            key=lambda each: abs(float(each[parameter.name]) - own),
        )
        moved = [self._moved(each) for each in ([others[-1], others[0]] if len(others) > 1 else others)]
        return [(moved[0], moved[-1])] if moved else []

    def _moved(self, values: dict[str, Value]) -> float:
        return self.surface.apart(_surface(self.program, values))


@dataclass(frozen=True, eq=False)
class _Surface:
    """points: float32 (n, 3) on it; casting: the surface as Open3D asks for distances; diagonal: of its box."""

    points: Any
    casting: Any
    diagonal: float

    def apart(self, other: _Surface) -> float:
        """The greatest distance of a point of either surface from the other one, as a share of this one's diagonal."""
        return max(self.greatest(other), other.greatest(self)) / self.diagonal

    def greatest(self, other: _Surface) -> float:
        """The greatest distance of a point of the other surface from this one."""
        return float(self.casting.compute_distance(other.points, nthreads=1).numpy().max())


def _surface(program: Program, values: Mapping[str, Value]) -> _Surface:
    import open3d as o3d

    mesh = QuadMesh.joined(part.mesh for part in program.parts(values))
    # The same numbers for each surface: what does not move is looked at in the same places.
    points, _, _ = sample_surface(mesh.vertices, mesh.triangles, SURFACE_SAMPLES, np.random.default_rng(0))
    casting = o3d.t.geometry.RaycastingScene(nthreads=1)
    casting.add_triangles(
        o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.triangles.astype(np.uint32))
    )
    every = np.concatenate([mesh.vertices, points]).astype(np.float32)
    return _Surface(o3d.core.Tensor(every), casting, float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))))
