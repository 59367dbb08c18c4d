"""From a mesh or a cloud to its grammar: motions, docking sites, dockers, productions and grids (symmetry §3, §4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.model import Model
from stages.grammars.extraction.docked_pieces import Docker, dockers_of
from stages.grammars.extraction.grids import Row, crossing, cut_grid, rows_of
from stages.grammars.extraction.productions import productions, seams_of
from stages.grammars.extraction.seams import Seam
from stages.grammars.extraction.terminals import Terminal, alone
from stages.grammars.grammar import GridRule, Rule, ShapeGrammar, site_name
from stages.grammars.scans.ridge_frames import ridge_frames
from stages.grammars.scans.scanned_grid import Cloud, cloud_grid
from stages.grammars.terminal_meshes import TerminalMeshes, part_around
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.symmetry.matching.candidate_transforms import candidate_motions
from stages.symmetry.surface.corner_frames import CornerFrames, corner_frames
from stages.symmetry.surface.grid import SurfaceGrid, surface_grid, with_area
from stages.symmetry.surface.welding import welded

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
    """A grammar, and what it was made of, in the cells of a grid. motions: how many; seconds: CPU seconds of surface,
    motions, dockers, grids and productions, by name."""

    grammar: ShapeGrammar
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
    surface: Mesh | Cloud,
    name: str,
    radius: float,
    up: Literal["y", "z"],
    rng: np.random.Generator,
    upright: bool = True,
) -> Extraction:
    """The grammar of a surface for a radius of similarity, as a share of the longest side of its box. That of a cloud
    is made of splats, a triangle for each point, which are never cut.

    upright: whether only motions are looked for that keep what points up: a front that is like itself upside down
    would get its door under the roof. Triangles without area are left out. Raises ConfigError for a mesh without any
    other, and for a cloud of which no grid can be made.
    """
    seconds: dict[str, float] = {}
    clock = time.process_time()

    def passed(what: str) -> None:
        nonlocal clock
        seconds[what], clock = time.process_time() - clock, time.process_time()

    grid, frames = _gridded(surface, name, radius)
    passed("surface")
    axis = np.eye(3)[{"y": 1, "z": 2}[up]] if upright else None
    motions = candidate_motions(grid, min(MOTIONS, max(1, WORK // len(grid))), axis, frames)
    passed("motions")
    dockers = dockers_of(grid, motions)
    seams = seams_of(grid, dockers)
    passed("dockers")
    rows = rows_of(grid, dockers, seams)
    grids = [
        cut_grid(grid, dockers, [rows[each] for each in chosen], seams) for chosen in crossing(grid, dockers, rows)
    ]
    passed("grids")
    found, pieces = productions(grid, dockers, seams, rng)
    passed("productions")
    terminals: list[tuple[str, Terminal]] = []

    def kept(name: str, terminal: Terminal) -> int:
        terminals.append((name, terminal))
        return len(terminals) - 1

    rules, counted = [], dict.fromkeys([each.site for each in found], 0)
    for each in found:
        called = f"{site_name(each.site)}{counted[each.site]}"
        counted[each.site] += 1
        rules.append(Rule(called, each.site, each.frame, kept(called, each.terminal), each.places))
    grid_rules = []
    for number, one in enumerate(grids):
        cut = [(kept(f"G{number}-{'-'.join(map(str, where))}", alone(soup)), where) for where, soup in one.pieces]
        grid_rules.append(GridRule(f"G{number}", one.motions, one.counts, one.sites, one.frames, tuple(cut)))
    colors = surface.colors[grid.faces]
    meshes = TerminalMeshes(grid.corners, pieces, colors, terminals, WELDED * grid.size)
    faces, vertices = welded(grid.corners, 0.0)
    grammar = ShapeGrammar(
        name=name,
        up=up,
        radius=grid.radius,
        meshes=meshes,
        middles=meshes.middles,
        rules=tuple(rules),
        grids=tuple(grid_rules),
        seams={site: grid.origin + (grid.cells[each.band] + 0.5) * grid.size for site, each in seams.items()},
        exemplar=part_around(np.zeros(3), "exemplar", faces, vertices, colors),
        splats=grid.splats,
    )
    return Extraction(grammar, grid, len(motions), dockers, seams, rows, seconds)


def _gridded(surface: Mesh | Cloud, name: str, radius: float) -> tuple[SurfaceGrid, CornerFrames]:
    """The grid of a surface, and the frames in its corners."""
    if isinstance(surface, Cloud):
        try:
            scan = cloud_grid(surface, radius)
        except ConfigError as error:
            raise ConfigError(f"{name}: {error}") from None
        return scan.grid, ridge_frames(scan)
    corners = surface.corners
    if not with_area(corners).any():
        raise ConfigError(f"{name}: no triangle has any area; export the model again, with its surfaces")
    grid = surface_grid(corners, radius)
    return grid, corner_frames(grid.corners, grid.tolerance)
