"""What the radius of similarity does to the grammar of a mesh (symmetry figure 10 j)."""

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

DOCKERS = 3
"""So many dockers are shown of each radius."""
SHAPES = 2
"""So many shapes by each method."""
CELL = 200


def extractions(path: Path, radii: Sequence[float], up: Literal["y", "z"]) -> dict[float, ExtractedGrammar]:
    """The grammar of the mesh or cloud in a file, whose axis `up` points up, for each radius, as a share of the longest
    side."""
    name = path.parent.name if path.stem == "model" else path.stem
    surface, _ = read_surface(path)
    return {each: extract_grammar(surface, name, each, up, decision_rng(0, "radii", name)) for each in radii}


def radii_table(found: dict[float, ExtractedGrammar]) -> Table:
    """A row for each radius."""
    rows: list[tuple[Cell, ...]] = []
    for radius, each in found.items():
        grids = ", ".join(" x ".join(map(str, one.counts)) for one in each.grammar.grids)
        sites = len({docker.site for docker in each.docked_pieces})
        counts = (len(each.grid), each.transforms, len(each.docked_pieces), sites, len(each.grammar.productions))
        rows.append((f"{radius:.1%}", *counts, grids or "none", sum(each.seconds.values())))
    columns = ("radius", "cells", "motions", "docking sites", "classes", "rules", "grids", "s")
    notes = (
        "Radius: of similarity, as a share of the longest side of the model's box. Grids: cells along their rows. "
        "s: CPU seconds.",
    )
    return Table("What the radius of similarity does", columns, tuple(rows), notes)


def radii_sheet(path: Path, found: dict[float, ExtractedGrammar]) -> Figure:
    """For each radius the model with its docking sites, some dockers, and some shapes by rules and by grids."""
    sections = []
    for radius, each in found.items():
        grammar = each.grammar
        config = GrammarConfig(name="radii", model=path.resolve(), radius=radius)
        shapes = [text for texts in preview_shapes(grammar, config, SHAPES).values() for text in texts]
        row = [*docked_pieces_row(each, DOCKERS), *shapes_row(grammar, shapes)]
        note = f"{each.transforms} motions, {len(grammar.productions)} rules, {len(grammar.grids)} grids"
        sections.append(Section(f"Radius {radius:.1%}", [row], note))
    name = next(iter(found.values())).grammar.name
    title = f"{name}: docking sites, dockers (yellow), shapes"
    return Figure(name.lower(), title, picture_png(contact_sheet(sections, title, CELL)))
