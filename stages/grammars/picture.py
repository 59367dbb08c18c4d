"""The picture of a grammar: the exemplar with its docking sites, what may dock at each, and its grids resized."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from stages.grammars.derivation_text import (
    PlacedTerminal,
    ResizedGrid,
    compact_shape_of_text,
    exemplar_shape,
    placed_terminals,
)
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

CELL = 200
COLUMNS = 4
CAMERA = Camera(azimuth=-36.0, elevation=24.0, fov=24.0, margin=0.06)
STAYS, COMES, GOES = (196, 192, 186), (204, 72, 58), (232, 186, 64)
SITES = 5
"""So many classes of sites are shown, those at which what may dock differs most in size."""
SIDES = 4
"""From so many sides it is looked at editing options, each time from that which the docker faces most."""
POINTS = 100_000
"""So many points of a cloud are drawn at most."""
OPTIONS = 3
"""So many editing options of one site, those that change most."""


def grammar_sheet(found: ExtractedGrammar) -> bytes:
    """A PNG: the exemplar, its sites in a colour for each class, and dockers; at a site of each class what may take the
    place of what is there, yellow, in red; and each grid with other numbers of cells."""
    grammar, whole = found.grammar, _whole(found)
    dockers = len(found.docked_pieces)
    classes = len({each.site for each in found.docked_pieces})
    exemplar = [
        _cell(found, [(whole, STAYS)], f"{len(grammar.exemplar.faces):,} {grammar.made_of}"),
        _cell(found, _sites(found), f"{dockers} docking sites of {classes} classes"),
    ]
    sections = [Section("Exemplar", [exemplar], f"{len(grammar.productions)} rules, {len(grammar.grids)} grids", 2)]
    rows = list(_editing(found))
    if rows:
        sections.append(Section("Editing options", rows, "yellow: what a site holds; red: what may take its place"))
    resized = [_grid_row(found, number, grid) for number, grid in enumerate(grammar.grids[:SITES])]
    if resized:
        sections.append(Section("Grids", resized, "cells along each row"))
    return picture_png(contact_sheet(sections, grammar.name, CELL))


def shapes_sheet(grammar: ShapeGrammar, texts: Sequence[str]) -> bytes:
    """A PNG: the exemplar, and the shapes of some derivations."""
    cells = [Cell(_pictured(exemplar_shape(grammar), grammar.splats), "the model"), *shapes_row(grammar, texts)]
    rows = [cells[place : place + COLUMNS] for place in range(0, len(cells), COLUMNS)]
    return picture_png(contact_sheet([Section("Shapes of the grammar", rows)], grammar.name, CELL))


def shapes_row(grammar: ShapeGrammar, texts: Sequence[str]) -> list[Cell]:
    """The shapes of some derivations, each with its text."""
    return [Cell(_pictured(compact_shape_of_text(grammar, each), grammar.splats), each) for each in texts]


def docked_pieces_row(found: ExtractedGrammar, most: int) -> list[Cell]:
    """The exemplar with its sites, and, of at most so many classes of sites, those at which most dock, the smallest
    docker."""
    classes = Counter(each.site for each in found.docked_pieces)
    cells = [_cell(found, _sites(found), f"{len(found.docked_pieces)} docking sites of {len(classes)} classes")]
    for site, count in sorted(classes.items(), key=lambda each: (-each[1], each[0]))[:most]:
        docker = next(each for each in found.docked_pieces if each.site == site)
        inside, outside = carve(_whole(found), found.grid, docker.cells, np.eye(4))
        caption = f"{site_name(site)}, one of {count}: {docker.area:.1%}"
        cells.append(_cell(found, [(outside, STAYS), (inside, GOES)], caption))
    return cells


def _whole(found: ExtractedGrammar) -> Soup:
    return Soup(found.grid.corners, np.arange(len(found.grid.corners), dtype=np.int32))


def _sites(found: ExtractedGrammar) -> list[tuple[Soup, tuple[int, int, int]]]:
    """The exemplar with what lies in the cells of docking sites in the colour of their class."""
    rest, parts = _whole(found), []
    colors = label_colors(1 + max((each.site for each in found.docked_pieces), default=0)).tolist()
    for docker in found.docked_pieces:
        red, green, blue = colors[docker.site]
        inside, rest = carve(rest, found.grid, docker.border, np.eye(4))
        parts.append((inside, (red, green, blue)))
    return [*parts, (rest, STAYS)]


def _editing(found: ExtractedGrammar) -> Iterator[list[Cell]]:
    """For the site of each class at which sizes differ most what is there, and what may be."""
    options = editing_options(found)

    def most(place: int) -> float:
        return max(
            abs(found.docked_pieces[each.other].area - found.docked_pieces[place].area) for each in options[place]
        )

    best: dict[int, int] = {}
    for place in sorted(options, key=lambda each: (-most(each), each)):
        best.setdefault(found.docked_pieces[place].site, place)
    for site, place in list(best.items())[:SITES]:
        docker = found.docked_pieces[place]
        inside, outside = carve(_whole(found), found.grid, docker.cells, np.eye(4))
        camera = _facing(inside, found.grammar.up)
        caption = f"{site_name(site)}: {docker.area:.0%} of it"
        cells = [_cell(found, [(outside, STAYS), (inside, GOES)], caption, camera)]
        chosen = sorted(options[place], key=lambda each: -abs(found.docked_pieces[each.other].area - docker.area))
        cells += [_option(found, each, camera) for each in chosen[:OPTIONS]]
        yield cells


def _facing(soup: Soup, up: Literal["y", "z"]) -> Camera:
    """Of cameras all around that which sees most of a surface, if nothing stands before it."""
    sides = [replace(CAMERA, azimuth=CAMERA.azimuth + 360.0 / SIDES * each) for each in range(SIDES)]
    ways = area_vectors(soup.corners)
    seen = [np.clip(ways @ eye_rotation(each.azimuth, each.elevation, up)[2], 0.0, None).sum() for each in sides]
    return sides[int(np.argmax(np.round(seen, 9)))]


def _option(found: ExtractedGrammar, option: EditingOption, camera: Camera) -> Cell:
    stays, comes = apply_option(found, option)
    return _cell(found, [(stays, STAYS), (comes, COMES)], f"{option.kind}: docker {option.other}", camera)


def _grid_row(found: ExtractedGrammar, number: int, grid: Grid) -> list[Cell]:
    """A grid with no cells, as in the exemplar, and with more along each row."""
    wanted: Sequence[tuple[int, ...]] = [
        tuple(0 for _ in grid.counts),
        grid.counts,
        *(tuple(each + 2 * (row == way) for row, each in enumerate(grid.counts)) for way in range(len(grid.counts))),
        tuple(each + 3 for each in grid.counts),
    ]
    return [_resized(found, number, counts) for counts in dict.fromkeys(wanted)][:COLUMNS]


def _resized(found: ExtractedGrammar, number: int, counts: tuple[int, ...]) -> Cell:
    grammar = found.grammar
    pieces = placed_terminals(grammar, ResizedGrid(number, counts))
    paint = dict(zip((mesh for mesh, _ in grammar.grids[number].pieces), label_colors(27).tolist(), strict=False))
    parts = [(_soup(grammar.meshes[each.mesh], each), tuple(paint[each.mesh])) for each in pieces]
    return _cell(found, parts, f"{grammar.grids[number].name}[{','.join(map(str, counts))}]")


def _soup(mesh: PartMesh, piece: PlacedTerminal) -> Soup:
    corners = transform_points(piece.pose, mesh.vertices)[mesh.faces]
    return Soup(corners, np.zeros(len(corners), dtype=np.int32))


def _cell(
    found: ExtractedGrammar, parts: Sequence[tuple[Soup, tuple[int, int, int]]], caption: str, camera: Camera = CAMERA
) -> Cell:
    filled = [(each, color) for each, color in parts if len(each)]
    meshes = tuple(_mesh(each.corners, color) for each, color in filled)
    types = np.arange(len(meshes), dtype=np.int16)
    assembly = Assembly(types, np.tile(np.eye(4), (len(meshes), 1, 1)), np.empty((0, 2), np.int32))
    shape = Shape(meshes, assembly, found.grammar.up, ("part",), one_surface=True)
    return Cell(_pictured(shape, found.grammar.splats, camera), caption)


def _pictured(shape: Shape, splats: bool, camera: Camera = CAMERA) -> ByteArray:
    """A portrait of a shape, or of the points that its splats stand for, of evenly many of them."""
    if not splats:
        return portrait(scene_of(shape), camera, (CELL, CELL))
    placed = [(shape.meshes[kind], pose) for kind, pose in zip(shape.assembly.types, shape.assembly.poses, strict=True)]
    step = 1 + sum(len(mesh.faces) for mesh, _ in placed) // POINTS
    points = [transform_points(pose, mesh.vertices[mesh.faces[::step]].mean(axis=1)) for mesh, pose in placed]
    paint: ByteArray = np.concatenate([mesh.face_colors[::step] for mesh, _ in placed])
    every = np.concatenate(points)
    return points_portrait(every, np.arange(len(every), dtype=np.int32), camera, (CELL, CELL), shape.up, paint)


def _mesh(corners: FloatArray, color: tuple[int, int, int]) -> PartMesh:
    colors: ByteArray = np.tile(np.array(color, np.uint8), (len(corners), 1))
    places, vertices = weld(corners, 0.0)
    return PartMesh("part", vertices, places, colors)
