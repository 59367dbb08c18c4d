"""The picture of a grammar: the exemplar with its docking sites, what may dock at each, and its resized grids."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from stages.grammars.derivation import ResizedGrid
from stages.grammars.derived_shape import PlacedTerminal, compact_shape_of_text, exemplar_shape, placed_terminals
from stages.grammars.editing import EditingOption, apply_option, editing_options
from stages.grammars.extraction.extract import ExtractedGrammar
from stages.grammars.grammar import Grid, ShapeGrammar, site_name
from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.geometry.pose import transform_points
from stages.shape.geometry.triangles import area_vectors
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape
from stages.shape.views.camera import Camera, eye_rotation
from stages.shape.views.palette import label_colors
from stages.shape.views.portrait import points_portrait, portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.symmetry.surface.soup import Soup, carve
from stages.symmetry.surface.welding import weld

Color = tuple[int, int, int]

CELL_PIXELS = 200
GRID_COLUMNS = 4
CAMERA = Camera(azimuth=-36.0, elevation=24.0, fov=24.0, margin=0.06)
STAYS, COMES, GOES = (196, 192, 186), (204, 72, 58), (232, 186, 64)
MAX_SITES_SHOWN = 5
"""Classes of sites whose editing options are shown, those with the largest differences in size."""
CAMERA_SIDES = 4
"""Directions from which editing options may be shown; the one that the docked piece faces most is taken."""
MAX_POINTS_SHOWN = 100_000
MAX_OPTIONS_SHOWN = 3
"""Editing options of one site that are shown, those that change most."""


def grammar_sheet(extracted: ExtractedGrammar) -> bytes:
    """Return a PNG of a grammar.

    It shows the exemplar, its sites in a colour for each class, and each grid with other numbers of cells. At a site of
    each class it shows the piece (yellow) and what may replace it (red).
    """
    grammar, whole = extracted.grammar, _whole(extracted)
    exemplar = [
        _cell(extracted, [(whole, STAYS)], f"{len(grammar.exemplar.faces):,} {grammar.made_of}"),
        _cell(extracted, _sites(extracted), _sites_caption(extracted)),
    ]
    note = f"{len(grammar.productions)} productions, {len(grammar.grids)} grids"
    sections = [Section("Exemplar", [exemplar], note, 2)]
    rows = list(_editing_rows(extracted))
    if rows:
        sections.append(Section("Editing options", rows, "yellow: what a site holds; red: what may replace it"))
    resized = [_grid_row(extracted, number, grid) for number, grid in enumerate(grammar.grids[:MAX_SITES_SHOWN])]
    if resized:
        sections.append(Section("Grids", resized, "cells along each row"))
    return picture_png(contact_sheet(sections, grammar.name, CELL_PIXELS))


def shapes_sheet(grammar: ShapeGrammar, texts: Sequence[str]) -> bytes:
    """Return a PNG of the exemplar and the shapes of some derivations."""
    cells = [Cell(_render(exemplar_shape(grammar), grammar.splats), "the model"), *shapes_row(grammar, texts)]
    rows = [cells[begin : begin + GRID_COLUMNS] for begin in range(0, len(cells), GRID_COLUMNS)]
    return picture_png(contact_sheet([Section("Shapes of the grammar", rows)], grammar.name, CELL_PIXELS))


def shapes_row(grammar: ShapeGrammar, texts: Sequence[str]) -> list[Cell]:
    """Return the shapes of some derivations, each with its text."""
    return [Cell(_render(compact_shape_of_text(grammar, text), grammar.splats), text) for text in texts]


def docked_pieces_row(extracted: ExtractedGrammar, max_classes: int) -> list[Cell]:
    """Return the exemplar with its sites, and the smallest piece of each of the largest `max_classes` classes."""
    pieces = extracted.docked_pieces
    classes = Counter(piece.site for piece in pieces)
    cells = [_cell(extracted, _sites(extracted), _sites_caption(extracted))]
    for site, count in sorted(classes.items(), key=lambda item: (-item[1], item[0]))[:max_classes]:
        piece = next(piece for piece in pieces if piece.site == site)
        inside, outside = carve(_whole(extracted), extracted.grid, piece.cells, np.eye(4))
        caption = f"{site_name(site)}, one of {count}: {piece.area:.1%}"
        cells.append(_cell(extracted, [(outside, STAYS), (inside, GOES)], caption))
    return cells


def _sites_caption(extracted: ExtractedGrammar) -> str:
    return f"{len(extracted.docked_pieces)} docking sites of {extracted.site_classes} classes"


def _whole(extracted: ExtractedGrammar) -> Soup:
    return Soup(extracted.grid.corners, np.arange(len(extracted.grid.corners), dtype=np.int32))


def _sites(extracted: ExtractedGrammar) -> list[tuple[Soup, Color]]:
    """Return the exemplar with the cells of docking sites in the colour of their class."""
    rest, parts = _whole(extracted), []
    colors = label_colors(1 + max((piece.site for piece in extracted.docked_pieces), default=0)).tolist()
    for piece in extracted.docked_pieces:
        red, green, blue = colors[piece.site]
        inside, rest = carve(rest, extracted.grid, piece.border, np.eye(4))
        parts.append((inside, (red, green, blue)))
    return [*parts, (rest, STAYS)]


def _editing_rows(extracted: ExtractedGrammar) -> Iterator[list[Cell]]:
    """Yield what is and what may be at the site of each class where sizes differ most."""
    options = editing_options(extracted)
    pieces = extracted.docked_pieces

    def largest_change(index: int) -> float:
        return max(abs(pieces[option.other].area - pieces[index].area) for option in options[index])

    best: dict[int, int] = {}
    for index in sorted(options, key=lambda index: (-largest_change(index), index)):
        best.setdefault(pieces[index].site, index)
    for site, index in list(best.items())[:MAX_SITES_SHOWN]:
        piece = pieces[index]
        inside, outside = carve(_whole(extracted), extracted.grid, piece.cells, np.eye(4))
        camera = _camera_facing(inside, extracted.grammar.up)
        caption = f"{site_name(site)}: {piece.area:.0%} of it"
        cells = [_cell(extracted, [(outside, STAYS), (inside, GOES)], caption, camera)]
        chosen = sorted(options[index], key=lambda option: -abs(pieces[option.other].area - piece.area))
        cells += [_option_cell(extracted, option, camera) for option in chosen[:MAX_OPTIONS_SHOWN]]
        yield cells


def _camera_facing(soup: Soup, up: Literal["y", "z"]) -> Camera:
    """Return the camera, of CAMERA_SIDES around, that sees most of a surface if nothing hides it."""
    cameras = [
        replace(CAMERA, azimuth=CAMERA.azimuth + 360.0 / CAMERA_SIDES * number) for number in range(CAMERA_SIDES)
    ]
    vectors = area_vectors(soup.corners)
    seen = [
        np.clip(vectors @ eye_rotation(camera.azimuth, camera.elevation, up)[2], 0.0, None).sum() for camera in cameras
    ]
    return cameras[int(np.argmax(np.round(seen, 9)))]


def _option_cell(extracted: ExtractedGrammar, option: EditingOption, camera: Camera) -> Cell:
    stays, comes = apply_option(extracted, option)
    return _cell(extracted, [(stays, STAYS), (comes, COMES)], f"{option.kind}: docked piece {option.other}", camera)


def _grid_row(extracted: ExtractedGrammar, number: int, grid: Grid) -> list[Cell]:
    """Return a grid without cells, as in the exemplar, and with more cells in each row."""
    rows = range(len(grid.counts))
    wanted: Sequence[tuple[int, ...]] = [
        tuple(0 for _ in rows),
        grid.counts,
        *(tuple(count + 2 * (row == longer) for row, count in enumerate(grid.counts)) for longer in rows),
        tuple(count + 3 for count in grid.counts),
    ]
    return [_resized_cell(extracted, number, counts) for counts in dict.fromkeys(wanted)][:GRID_COLUMNS]


def _resized_cell(extracted: ExtractedGrammar, number: int, counts: tuple[int, ...]) -> Cell:
    grammar = extracted.grammar
    terminals = placed_terminals(grammar, ResizedGrid(number, counts))
    paint = dict(zip((mesh for mesh, _ in grammar.grids[number].pieces), label_colors(27).tolist(), strict=False))
    parts = [(_soup(grammar.meshes[placed.mesh], placed), tuple(paint[placed.mesh])) for placed in terminals]
    return _cell(extracted, parts, f"{grammar.grids[number].name}[{','.join(map(str, counts))}]")


def _soup(mesh: PartMesh, placed: PlacedTerminal) -> Soup:
    corners = transform_points(placed.pose, mesh.vertices)[mesh.faces]
    return Soup(corners, np.zeros(len(corners), dtype=np.int32))


def _cell(
    extracted: ExtractedGrammar, parts: Sequence[tuple[Soup, Color]], caption: str, camera: Camera = CAMERA
) -> Cell:
    meshes = tuple(_mesh(soup.corners, color) for soup, color in parts if len(soup))
    types = np.arange(len(meshes), dtype=np.int16)
    assembly = Assembly(types, np.tile(np.eye(4), (len(meshes), 1, 1)), np.empty((0, 2), np.int32))
    shape = Shape(meshes, assembly, extracted.grammar.up, ("part",), one_surface=True)
    return Cell(_render(shape, extracted.grammar.splats, camera), caption)


def _render(shape: Shape, splats: bool, camera: Camera = CAMERA) -> ByteArray:
    """Render a shape, or evenly chosen points of its splats."""
    if not splats:
        return portrait(scene_of(shape), camera, (CELL_PIXELS, CELL_PIXELS))
    placed = [(shape.meshes[kind], pose) for kind, pose in zip(shape.assembly.types, shape.assembly.poses, strict=True)]
    step = 1 + sum(len(mesh.faces) for mesh, _ in placed) // MAX_POINTS_SHOWN
    centres = [transform_points(pose, mesh.vertices[mesh.faces[::step]].mean(axis=1)) for mesh, pose in placed]
    colors: ByteArray = np.concatenate([mesh.face_colors[::step] for mesh, _ in placed])
    points = np.concatenate(centres)
    labels = np.arange(len(points), dtype=np.int32)
    return points_portrait(points, labels, camera, (CELL_PIXELS, CELL_PIXELS), shape.up, colors)


def _mesh(corners: FloatArray, color: Color) -> PartMesh:
    colors: ByteArray = np.tile(np.array(color, np.uint8), (len(corners), 1))
    indices, vertices = weld(corners, 0.0)
    return PartMesh("part", vertices, indices, colors)
