"""How far each parameter moves the surface: which parameters can be read from a cloud or a drawing."""

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
from stages.shape.arrays import Float32Array, FloatArray, IntArray

MIN_RANGE_MOVEMENT, MIN_CLASS_MOVEMENT = 0.005, 0.0025
"""A parameter whose whole range, or whose next value, moves the surface less is hard to read; in diagonals."""
MIN_VISIBLE_SHARE = 0.8
"""Of the base shapes, for a parameter that is not weak."""

MAX_BASES_PER_SHAPE = 50
"""Random shapes drawn for each shape in which a parameter is visible."""
SURFACE_SAMPLES = 4000
"""Points of each surface whose distances are computed, besides its vertices."""


@dataclass(frozen=True)
class Movement:
    """How one parameter moves the surfaces of base shapes in which it is visible: Hausdorff distances in diagonals.

    far: float64 (bases,), by its farthest other value
    step: float64 (bases,), by its nearest other value
    """

    parameter: Parameter
    far: FloatArray
    step: FloatArray

    @property
    def visible_share(self) -> float:
        """The share of the base shapes whose surface its farthest value moves noticeably."""
        return float((self.far > MIN_RANGE_MOVEMENT).mean())

    @property
    def weak(self) -> bool:
        """Whether a fifth of the base shapes do not show it, or half of them do not distinguish its classes."""
        return self.visible_share < MIN_VISIBLE_SHARE or float(np.median(self.step)) < MIN_CLASS_MOVEMENT


def movements(program: Program, count: int, seed: int) -> Iterator[Movement]:
    """Measure each parameter on `count` random valid base shapes in which it is visible, or on all if there are fewer.

    Only values that satisfy every constraint count. Raises ValueError for a parameter that is never visible.
    """
    sampler, rng = Sampler(program, Share(), off_grid=False), np.random.default_rng(seed)
    known: list[_Base] = []
    for parameter in program.parameters:
        distances: list[tuple[float, float]] = []
        for base in islice(_bases(known, sampler, rng), MAX_BASES_PER_SHAPE * count):
            distances += base.moved_by(parameter)
            if len(distances) == count:
                break
        if not distances:
            raise ValueError(f"{program.name}: no shape shows another value of {parameter.name}")
        far, step = np.array(distances).T
        yield Movement(parameter, far, step)


def surface_movements(
    program: Program, values: Mapping[str, Value], changes: Sequence[Mapping[str, Value]]
) -> FloatArray:
    """Measure how far each change moves the surface of the shape at `values`, in diagonals, float64 (changes,).

    The measure is the Hausdorff distance. It is infinite for a change that violates a constraint or fails to build.
    """
    surface = _surface(program, values)
    distances = []
    for change in changes:
        changed = {**values, **change}
        try:
            distances.append(np.inf if program.violated(changed) else surface.hausdorff(_surface(program, changed)))
        except BuildError:
            distances.append(np.inf)
    return np.array(distances)


def movement_table(measured: Sequence[Movement]) -> str:
    """The movements as a Markdown table, one line per parameter. Ends with a newline."""
    lines = [
        f"| parameter | shapes whose surface the far end of its range moves by more than {MIN_RANGE_MOVEMENT:.1%}"
        " | median, far end "
        "| median, next class | |",
        "|---|---:|---:|---:|---|",
    ]
    for movement in measured:
        far, step = (f"{np.median(distances):.2%}" for distances in (movement.far, movement.step))
        name, weak = movement.parameter.name, "weak" if movement.weak else ""
        lines.append(f"| `{name}` | {movement.visible_share:.0%} | {far} | {step} | {weak} |")
    return "\n".join(lines) + "\n"


def _bases(known: list[_Base], sampler: Sampler, rng: np.random.Generator) -> Iterator[_Base]:
    """Yield the known bases, then new ones, which are added to them."""
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
        """The distances of the farthest and of the nearest other value; empty where the parameter is hidden."""
        if parameter.name not in self.program.schema.canonical(self.values)[1]:
            return []
        own = float(self.values[parameter.name])
        changed = [{**self.values, parameter.name: value} for value in parameter.values if float(value) != own]
        others = sorted(
            (values for values in changed if not self.program.violated(values)),
            key=lambda values: abs(float(values[parameter.name]) - own),
        )
        extremes = [others[-1], others[0]] if len(others) > 1 else others
        distances = [self.surface.hausdorff(_surface(self.program, values)) for values in extremes]
        return [(distances[0], distances[-1])] if distances else []


@dataclass(frozen=True, eq=False)
class _Surface:
    """A surface ready for distances.

    points: float32 (n, 3), on it
    part_of_point: int (n,)
    parts: bytes of the vertices of each part
    scene: the surface in Open3D
    diagonal: of its bounding box
    """

    points: Float32Array
    part_of_point: IntArray
    parts: tuple[bytes, ...]
    scene: Any
    diagonal: float

    def hausdorff(self, other: _Surface) -> float:
        """The Hausdorff distance, in diagonals of this surface."""
        return max(self._max_distance(other), other._max_distance(self)) / self.diagonal

    def _max_distance(self, other: _Surface) -> float:
        """The greatest distance of a point of the other surface from this one; 0 on parts that both have."""
        import open3d as o3d

        own = set(self.parts)
        is_moved = np.array([part not in own for part in other.parts])[other.part_of_point]
        if not is_moved.any():
            return 0.0
        points = o3d.core.Tensor(other.points[is_moved])
        return float(self.scene.compute_distance(points, nthreads=1).numpy().max())


def _surface(program: Program, values: Mapping[str, Value]) -> _Surface:
    import open3d as o3d

    meshes = [part.mesh for part in program.parts(values)]
    mesh, part_of_vertex = QuadMesh.joined(meshes), np.repeat(np.arange(len(meshes)), [len(m.vertices) for m in meshes])
    points, _, faces = sample_surface(mesh.vertices, mesh.triangles, SURFACE_SAMPLES, np.random.default_rng(0))
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.triangles.astype(np.uint32))
    )
    tested = np.concatenate([mesh.vertices, points]).astype(np.float32)
    part_of_point = np.concatenate([part_of_vertex, part_of_vertex[mesh.triangles[faces, 0]]])
    parts = tuple(part.vertices.tobytes() for part in meshes)
    return _Surface(tested, part_of_point, parts, scene, float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))))
