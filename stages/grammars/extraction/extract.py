"""From a mesh or a cloud to its grammar: motions, docking sites, dockers, productions and grids (symmetry §3, §4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.model import Model
from stages.grammars.extraction.docked_pieces import DockedPiece, find_docked_pieces
from stages.grammars.extraction.grids import GridRow, crossing_rows, cut_grid, find_rows
from stages.grammars.extraction.productions import extract_productions, seams_by_site
from stages.grammars.extraction.seams import Seam
from stages.grammars.extraction.terminals import Terminal, unshared_terminal
from stages.grammars.grammar import Grid, Production, ShapeGrammar, site_name
from stages.grammars.scans.ridge_frames import ridge_frames
from stages.grammars.scans.scanned_grid import ScannedCloud, scanned_grid
from stages.grammars.terminal_meshes import TerminalMeshes, centred_part
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.surface.corner_frames import CornerFrames, corner_frames
from stages.symmetry.surface.grid import SurfaceGrid, has_area, surface_grid
from stages.symmetry.surface.welding import weld

MOTIONS = 24
"""So many motions are looked at, of a grid of many cells fewer."""
WORK = 8_000_000
"""Cells that are looked at in all, each once for a motion."""
WELDED = 1e-6
"""Corners of pieces are one vertex where they are closer than this share of a cell."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
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
class ExtractedGrammar:
    """A grammar, and what it was made of, in the cells of a grid. motions: how many; seconds: CPU seconds of surface,
    motions, dockers, grids and productions, by name."""

    grammar: ShapeGrammar
    grid: SurfaceGrid
    transforms: int
    docked_pieces: Sequence[DockedPiece]
    seams: dict[int, Seam]
    rows: Sequence[GridRow]
    seconds: dict[str, float]


def model_surface(model: Model) -> SurfaceMesh:
    """All parts of a model where they stand, as one mesh."""
    vertices = [transform_points(each.pose, each.vertices) for each in model.parts]
    shifts = np.cumsum([0, *(len(each) for each in vertices[:-1])])
    faces = [each.faces + shift for each, shift in zip(model.parts, shifts, strict=True)]
    return SurfaceMesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate([each.face_colors for each in model.parts]),
    )


def extract_grammar(
    surface: SurfaceMesh | ScannedCloud,
    name: str,
    radius: float,
    up: Literal["y", "z"],
    rng: np.random.Generator,
    upright: bool = True,
) -> ExtractedGrammar:
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
    motions = candidate_transforms(grid, min(MOTIONS, max(1, WORK // len(grid))), axis, frames)
    passed("motions")
    dockers = find_docked_pieces(grid, motions)
    seams = seams_by_site(grid, dockers)
    passed("dockers")
    rows = find_rows(grid, dockers, seams)
    grids = [
        cut_grid(grid, dockers, [rows[each] for each in chosen], seams) for chosen in crossing_rows(grid, dockers, rows)
    ]
    passed("grids")
    found, pieces = extract_productions(grid, dockers, seams, rng)
    passed("extract_productions")
    terminals: list[tuple[str, Terminal]] = []

    def kept(name: str, terminal: Terminal) -> int:
        terminals.append((name, terminal))
        return len(terminals) - 1

    rules, counted = [], dict.fromkeys([each.site for each in found], 0)
    for each in found:
        called = f"{site_name(each.site)}{counted[each.site]}"
        counted[each.site] += 1
        rules.append(Production(called, each.site, each.frame, kept(called, each.terminal), each.non_terminals))
    grid_rules = []
    for number, one in enumerate(grids):
        cut = [
            (kept(f"G{number}-{'-'.join(map(str, where))}", unshared_terminal(soup)), where)
            for where, soup in one.pieces
        ]
        grid_rules.append(Grid(f"G{number}", one.transforms, one.counts, one.sites, one.frames, tuple(cut)))
    colors = surface.colors[grid.faces]
    meshes = TerminalMeshes(grid.corners, pieces, colors, terminals, WELDED * grid.cell_size)
    faces, vertices = weld(grid.corners, 0.0)
    grammar = ShapeGrammar(
        name=name,
        up=up,
        radius=grid.radius,
        meshes=meshes,
        middles=meshes.middles,
        productions=tuple(rules),
        grids=tuple(grid_rules),
        seams={site: grid.origin + (grid.cells[each.band] + 0.5) * grid.cell_size for site, each in seams.items()},
        exemplar=centred_part(np.zeros(3), "exemplar", faces, vertices, colors),
        splats=grid.splats,
    )
    return ExtractedGrammar(grammar, grid, len(motions), dockers, seams, rows, seconds)


def _gridded(surface: SurfaceMesh | ScannedCloud, name: str, radius: float) -> tuple[SurfaceGrid, CornerFrames]:
    """The grid of a surface, and the frames in its corners."""
    if isinstance(surface, ScannedCloud):
        try:
            scan = scanned_grid(surface, radius)
        except ConfigError as error:
            raise ConfigError(f"{name}: {error}") from None
        return scan.grid, ridge_frames(scan)
    corners = surface.corners
    if not has_area(corners).any():
        raise ConfigError(f"{name}: no triangle has any area; export the model again, with its surfaces")
    grid = surface_grid(corners, radius)
    return grid, corner_frames(grid.corners, grid.tolerance)
