"""From a mesh to its grammar: motions, docking sites, dockers, productions and grids (symmetry §3, §4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.model import Model
from stages.exemplars.symmetry.carve import Soup
from stages.exemplars.symmetry.grids import Row, crossing, cut_grid, rows_of
from stages.exemplars.symmetry.motions import candidate_motions
from stages.exemplars.symmetry.productions import productions, seams_of
from stages.exemplars.symmetry.seams import Seam
from stages.exemplars.symmetry.sites import Docker, dockers_of
from stages.exemplars.symmetry.surface import SurfaceGrid, surface_grid, with_area
from stages.exemplars.symmetry.welding import welded
from stages.grammars.grammar import GridRule, Rule, ShapeGrammar, site_name
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import PartMesh

__all__ = ["Extraction", "Mesh", "extract", "mesh_of"]

MOTIONS = 24
"""So many motions are looked at, of a grid of many cells fewer."""
WORK = 8_000_000
"""Cells that are looked at in all, each once for a motion."""
WELDED = 1e-6
"""Corners of pieces are one vertex where they are closer than this share of a cell."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh: vertices float64 (v, 3), faces int32 (f, 3), face colours uint8 (f, 3) sRGB."""

    vertices: FloatArray
    faces: IntArray
    colors: ByteArray

    @property
    def corners(self) -> FloatArray:
        """Of each triangle, float64 (f, 3, 3)."""
        found: FloatArray = self.vertices[self.faces]
        return found


@dataclass(frozen=True, eq=False)
class Extraction:
    """A grammar, and what it was made of. motions: how many; seconds: CPU seconds of surface, motions, dockers,
    grids and productions, by name."""

    grammar: ShapeGrammar
    mesh: Mesh
    grid: SurfaceGrid
    motions: int
    dockers: Sequence[Docker]
    seams: dict[int, Seam]
    rows: Sequence[Row]
    seconds: dict[str, float]


def mesh_of(model: Model) -> Mesh:
    """All parts of a model where they stand, as one mesh."""
    vertices = [transform_points(each.pose, each.vertices) for each in model.parts]
    shifts = np.cumsum([0, *(len(each) for each in vertices[:-1])])
    faces = [each.faces + shift for each, shift in zip(model.parts, shifts, strict=True)]
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate([each.face_colors for each in model.parts]),
    )


def extract(
    mesh: Mesh, name: str, radius: float, up: Literal["y", "z"], rng: np.random.Generator, upright: bool = True
) -> Extraction:
    """The grammar of a mesh for a radius of similarity, as a share of the longest side of its box.

    upright: whether only motions are looked for that keep what points up: a front that is like itself upside down
    would get its door under the roof. Triangles without area are left out. Raises ConfigError for a mesh without any
    other.
    """
    corners = mesh.corners
    if not with_area(corners).any():
        raise ConfigError(f"{name}: no triangle has any area; export the model again, with its surfaces")
    seconds: dict[str, float] = {}
    clock = time.process_time()

    def passed(what: str) -> None:
        nonlocal clock
        seconds[what], clock = time.process_time() - clock, time.process_time()

    grid = surface_grid(corners, radius)
    passed("surface")
    axis = np.eye(3)[{"y": 1, "z": 2}[up]] if upright else None
    motions = candidate_motions(grid, min(MOTIONS, max(1, WORK // len(grid))), axis)
    passed("motions")
    dockers = dockers_of(grid, motions)
    seams = seams_of(grid, dockers)
    passed("dockers")
    rows = rows_of(grid, dockers, seams)
    grids = [
        cut_grid(grid, dockers, [rows[each] for each in chosen], seams) for chosen in crossing(grid, dockers, rows)
    ]
    passed("grids")
    found = productions(grid, dockers, seams, rng)
    passed("productions")
    meshes: list[PartMesh] = []
    middles: list[FloatArray] = []

    def kept(name: str, soup: Soup) -> int:
        middle, part = _part(name, soup, mesh.colors[grid.faces], WELDED * grid.size)
        meshes.append(part)
        middles.append(middle)
        return len(meshes) - 1

    rules, counted = [], dict.fromkeys([each.site for each in found], 0)
    for each in found:
        called = f"{site_name(each.site)}{counted[each.site]}"
        counted[each.site] += 1
        rules.append(Rule(called, each.site, each.frame, kept(called, each.terminal.soup()), each.places))
    grid_rules = []
    for number, one in enumerate(grids):
        pieces = [(kept(f"G{number}-{'-'.join(map(str, where))}", soup), where) for where, soup in one.pieces]
        grid_rules.append(GridRule(f"G{number}", one.motions, one.counts, one.sites, one.frames, tuple(pieces)))
    whole = _part(
        "exemplar", Soup(grid.corners, np.arange(len(grid.corners), dtype=np.int32)), mesh.colors[grid.faces], 0
    )
    grammar = ShapeGrammar(
        name=name,
        up=up,
        radius=grid.radius,
        meshes=tuple(meshes),
        middles=np.array(middles).reshape(-1, 3),
        rules=tuple(rules),
        grids=tuple(grid_rules),
        seams={site: grid.origin + (grid.cells[each.band] + 0.5) * grid.size for site, each in seams.items()},
        exemplar=PartMesh("exemplar", whole[1].vertices + whole[0], whole[1].faces, whole[1].face_colors),
    )
    return Extraction(grammar, mesh, grid, len(motions), dockers, seams, rows, seconds)


def _part(name: str, soup: Soup, colors: ByteArray, tolerance: float) -> tuple[FloatArray, PartMesh]:
    """Where the middle of a soup's box is, and its mesh around it, corners at one place one vertex."""
    faces, vertices = welded(soup.corners, tolerance)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    real = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return middle, PartMesh(name, vertices - middle, faces[real], colors[soup.faces[real]])
