"""From a mesh or a cloud to its grammar: transforms, docking sites, docked pieces, productions and grids
(symmetry §3, §4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, overload

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.model import Model
from stages.grammars.extraction.docked_pieces import DockedPiece, find_docked_pieces
from stages.grammars.extraction.grids import GridRow, crossing_rows, cut_grid, find_one_grids
from stages.grammars.extraction.productions import extract_productions, seams_by_site
from stages.grammars.extraction.seams import Seam
from stages.grammars.extraction.terminals import Terminal, unshared_terminal
from stages.grammars.grammar import Grid, Production, ShapeGrammar, site_name
from stages.grammars.scans.ridge_frames import ridge_frames
from stages.grammars.scans.scanned_grid import ScannedCloud, scanned_grid
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import LengthUnit, PartMesh
from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.surface.corner_frames import CornerFrames, corner_frames
from stages.symmetry.surface.grid import SurfaceGrid, has_area, surface_grid
from stages.symmetry.surface.soup import Soup, join_soups
from stages.symmetry.surface.welding import WeldedSurface, weld

MAX_TRANSFORMS = 24
MAX_CELL_TESTS = 8_000_000
"""Cells tested in all, once per transform: large grids are searched with fewer transforms."""
WELD_CELLS = 1e-6
"""Corners of pieces that are closer, in cells, are one vertex."""


class TerminalMeshes(Sequence[PartMesh]):
    """A mesh for each terminal, around the middle of its box.

    A mesh is made whenever it is read: hundreds that each hold most of a large surface take gigabytes.
    """

    def __init__(
        self,
        corners: FloatArray,
        pieces: Soup,
        colors: ByteArray,
        terminals: Sequence[tuple[str, Terminal]],
        tolerance: float,
    ) -> None:
        """Prepare the meshes of a surface.

        corners: float64 (f, 3, 3), triangles of the surface
        pieces: pieces of triangles that seams have cut
        colors: uint8 (f, 3), of the triangles
        terminals: each with its name
        tolerance: distance up to which corners are one vertex
        """
        every = join_soups(Soup(corners, np.arange(len(corners), dtype=np.int32)), pieces)
        self._surface = WeldedSurface(every.corners, tolerance)
        self._faces, self._first, self._colors = every.faces, len(corners), colors
        self._terminals = tuple(terminals)

    def __len__(self) -> int:
        return len(self._terminals)

    @overload
    def __getitem__(self, index: int) -> PartMesh: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[PartMesh]: ...
    def __getitem__(self, index: int | slice) -> PartMesh | Sequence[PartMesh]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        name, terminal = self._terminals[index]
        whole, pieces = terminal.whole.indices, self._first + terminal.pieces
        faces, vertices = self._surface.around(whole, terminal.cut.corners, pieces)
        colors = self._colors[np.concatenate([whole, terminal.cut.faces, self._faces[pieces]])]
        return centred_part(self.middles[index], name, faces, vertices, colors)

    @cached_property
    def middles(self) -> FloatArray:
        """Where the middle of each mesh's box is in the exemplar, float64 (m, 3)."""
        boxes = [
            self._surface.box(terminal.whole.indices, terminal.cut.corners, self._first + terminal.pieces)
            for _, terminal in self._terminals
        ]
        middles: FloatArray = np.array(boxes).reshape(-1, 2, 3).mean(axis=1)
        return middles


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A mesh: vertices float64 (v, 3) in `unit`, faces int32 (f, 3), face colours uint8 (f, 3) sRGB."""

    vertices: FloatArray
    faces: IntArray
    colors: ByteArray
    unit: LengthUnit = "unknown"

    @property
    def corners(self) -> FloatArray:
        """Corners of each triangle, float64 (f, 3, 3)."""
        corners: FloatArray = self.vertices[self.faces]
        return corners


@dataclass(frozen=True, eq=False)
class ExtractedGrammar:
    """A grammar, and what it was made from, in the cells of a grid.

    transforms: number of rigid transforms that were found
    seams: by class of sites
    seconds: CPU seconds of the steps, by name
    """

    grammar: ShapeGrammar
    grid: SurfaceGrid
    transforms: int
    docked_pieces: Sequence[DockedPiece]
    seams: dict[int, Seam]
    rows: Sequence[GridRow]
    seconds: dict[str, float]

    @property
    def site_classes(self) -> int:
        """Number of classes of docking sites."""
        return len({piece.site for piece in self.docked_pieces})


def model_surface(model: Model) -> SurfaceMesh:
    """Return all parts of a model at their poses as one mesh."""
    vertices = [transform_points(part.pose, part.vertices) for part in model.parts]
    shifts = np.cumsum([0, *map(len, vertices[:-1])])
    faces = [part.faces + shift for part, shift in zip(model.parts, shifts, strict=True)]
    return SurfaceMesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate([part.face_colors for part in model.parts]),
        "metre" if model.unit == 1.0 else "unknown",
    )


def extract_grammar(
    surface: SurfaceMesh | ScannedCloud,
    name: str,
    radius: float,
    up: Literal["y", "z"],
    rng: np.random.Generator,
    upright: bool = True,
) -> ExtractedGrammar:
    """Extract the grammar of a surface; that of a cloud consists of splats, one per point, which are never cut.

    radius: of similarity, as a share of the longest side of the box
    upright: whether only transforms count that keep the up axis; otherwise a front that equals itself upside down
        would get its door under the roof

    Triangles without area are left out. Raises ConfigError for a mesh of such triangles alone, and for a cloud that
    makes no grid.
    """
    seconds: dict[str, float] = {}
    clock = time.process_time()

    def finish(step: str) -> None:
        nonlocal clock
        seconds[step], clock = time.process_time() - clock, time.process_time()

    grid, frames = _grid_and_frames(surface, name, radius)
    finish("surface")
    axis = np.eye(3)[{"y": 1, "z": 2}[up]] if upright else None
    transforms = candidate_transforms(grid, min(MAX_TRANSFORMS, max(1, MAX_CELL_TESTS // len(grid))), axis, frames)
    finish("transforms")
    pieces = find_docked_pieces(grid, transforms)
    seams = seams_by_site(grid, pieces)
    finish("docked pieces")
    rows = find_one_grids(grid, pieces, seams)
    extracted_grids = [
        cut_grid(grid, pieces, [rows[index] for index in chosen], seams) for chosen in crossing_rows(grid, pieces, rows)
    ]
    finish("grids")
    extracted, triangle_pieces = extract_productions(grid, pieces, seams, rng)
    finish("productions")
    terminals: list[tuple[str, Terminal]] = []

    def add_terminal(name: str, terminal: Terminal) -> int:
        terminals.append((name, terminal))
        return len(terminals) - 1

    productions, counts = [], dict.fromkeys([production.site for production in extracted], 0)
    for production in extracted:
        called = f"{site_name(production.site)}{counts[production.site]}"
        counts[production.site] += 1
        terminal = add_terminal(called, production.terminal)
        productions.append(Production(called, production.site, production.frame, terminal, production.non_terminals))
    grids = []
    for number, cut in enumerate(extracted_grids):
        parts = [
            (add_terminal(f"G{number}-{'-'.join(map(str, along))}", unshared_terminal(soup)), along)
            for along, soup in cut.pieces
        ]
        grids.append(Grid(f"G{number}", cut.transforms, cut.counts, cut.sites, cut.frames, tuple(parts)))
    colors = surface.colors[grid.faces]
    meshes = TerminalMeshes(grid.corners, triangle_pieces, colors, terminals, WELD_CELLS * grid.cell_size)
    faces, vertices = weld(grid.corners, 0.0)
    grammar = ShapeGrammar(
        name=name,
        up=up,
        radius=grid.radius,
        meshes=meshes,
        middles=meshes.middles,
        productions=tuple(productions),
        grids=tuple(grids),
        seams={site: grid.centres(seam.band) for site, seam in seams.items()},
        exemplar=centred_part(np.zeros(3), "exemplar", faces, vertices, colors),
        splats=grid.splats,
        unit=surface.unit,
    )
    return ExtractedGrammar(grammar, grid, len(transforms), pieces, seams, rows, seconds)


def _grid_and_frames(surface: SurfaceMesh | ScannedCloud, name: str, radius: float) -> tuple[SurfaceGrid, CornerFrames]:
    """Return the grid of a surface, and the frames in its corners."""
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


def centred_part(middle: FloatArray, name: str, faces: IntArray, vertices: FloatArray, colors: ByteArray) -> PartMesh:
    """Return a mesh with its origin at `middle` (3,), without triangles of fewer than three vertices."""
    one, two, three = faces.T
    real = (one != two) & (two != three) & (three != one)
    return PartMesh(name, vertices - middle, faces[real], colors[real])
