"""Grammars of a mesh by radius of similarity (symmetry figure 10 j)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from eval.engine.evaluation import Figure
from eval.engine.table import Cell, Table
from pipeline.randomness import decision_rng
from stages.grammars.distinct_shapes import preview_shapes
from stages.grammars.extraction.extract import ExtractedGrammar, extract_grammar
from stages.grammars.picture import docked_pieces_row, shapes_row
from stages.grammars.read_surface import read_surface
from stages.grammars.settings import GrammarConfig
from stages.shape.views.sheet import Section, contact_sheet, picture_png

SITES_SHOWN = 3
SHAPES_PER_METHOD = 2
PICTURE_WIDTH = 200


def extractions(path: Path, radii: Sequence[float], up: Literal["y", "z"]) -> dict[float, ExtractedGrammar]:
    """Extract the grammar of the mesh or cloud in a file for each radius, as a share of the longest side."""
    name = path.parent.name if path.stem == "model" else path.stem
    surface, _, _ = read_surface(path)
    return {radius: extract_grammar(surface, name, radius, up, decision_rng(0, "radii", name)) for radius in radii}


def radius_table(by_radius: dict[float, ExtractedGrammar]) -> Table:
    """Return one row for each radius."""
    rows: list[tuple[Cell, ...]] = []
    for radius, extraction in by_radius.items():
        grids = ", ".join(" x ".join(map(str, grid.counts)) for grid in extraction.grammar.grids)
        sites = len({piece.site for piece in extraction.docked_pieces})
        counts = (
            len(extraction.grid),
            extraction.transforms,
            len(extraction.docked_pieces),
            sites,
            len(extraction.grammar.productions),
        )
        rows.append((f"{radius:.1%}", *counts, grids or "none", sum(extraction.seconds.values())))
    columns = ("radius", "cells", "transforms", "docking sites", "classes", "productions", "grids", "s")
    notes = (
        "Radius: of similarity, as a share of the longest side of the model's box. Grids: cells along their rows. "
        "s: CPU seconds.",
    )
    return Table("Grammar by radius of similarity", columns, tuple(rows), notes)


def radius_figure(path: Path, by_radius: dict[float, ExtractedGrammar]) -> Figure:
    """Show, for each radius, the model with its docking sites, some docked pieces, and shapes by rules and by grids."""
    sections = []
    for radius, extraction in by_radius.items():
        grammar = extraction.grammar
        config = GrammarConfig(name="radii", model=path.resolve(), radius=radius)
        shapes = [text for texts in preview_shapes(grammar, config, SHAPES_PER_METHOD).values() for text in texts]
        row = [*docked_pieces_row(extraction, SITES_SHOWN), *shapes_row(grammar, shapes)]
        note = f"{extraction.transforms} transforms, {len(grammar.productions)} productions, {len(grammar.grids)} grids"
        sections.append(Section(f"Radius {radius:.1%}", [row], note))
    name = next(iter(by_radius.values())).grammar.name
    title = f"{name}: docking sites, docked pieces (yellow), shapes"
    return Figure(name.lower(), title, picture_png(contact_sheet(sections, title, PICTURE_WIDTH)))
