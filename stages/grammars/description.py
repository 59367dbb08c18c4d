"""A grammar as JSON that people can read: sites, docked pieces, productions, terminals, grids."""

from __future__ import annotations

from typing import Any

import numpy as np

from stages.grammars.derivation import GRID_PARTS, Derivation
from stages.grammars.derivation_text import format_derivation
from stages.grammars.editing import editing_options
from stages.grammars.extraction.extract import ExtractedGrammar
from stages.grammars.grammar import Grid, Production, ShapeGrammar, site_name


def describe_grammar(extracted: ExtractedGrammar) -> dict[str, Any]:
    """Describe a grammar, with the editing options at each docking site.

    Programs read `tree`, an original as indices of productions, and `frame`, a pose (4, 4).
    """
    grammar = extracted.grammar
    pieces = extracted.docked_pieces
    options = editing_options(extracted)
    return {
        "grammar": grammar.name,
        "up": grammar.up,
        "unit": grammar.unit,
        "radius": grammar.radius,
        "made_of": grammar.made_of,
        grammar.made_of: len(grammar.exemplar.faces),
        "area": float(extracted.grid.area.sum()),
        "transforms": extracted.transforms,
        "docked_pieces": len(pieces),
        "sites": [
            {
                "name": site_name(site),
                "site": site,
                "docked_pieces": sum(piece.site == site for piece in pieces),
                "productions": [grammar.productions[number].name for number in numbers],
            }
            for site, numbers in grammar.productions_of_site.items()
        ],
        "productions": [_production(grammar, production) for production in grammar.productions],
        "grids": [_grid(grid) for grid in grammar.grids],
        "terminals": [
            {
                "name": mesh.name,
                grammar.made_of: len(mesh.faces),
                "size": [round(float(side), 6) for side in np.ptp(mesh.bounds, axis=0)],
                "middle": middle.tolist(),
            }
            for mesh, middle in zip(grammar.meshes, grammar.middles, strict=True)
        ],
        "editing": [
            {
                "docked_piece": number,
                "site": site_name(piece.site),
                "share": round(piece.area, 6),
                "at": [round(float(coordinate), 6) for coordinate in _middle(extracted, number)],
                "options": [
                    {
                        "docked_piece": option.other,
                        "kind": option.kind,
                        "share": round(pieces[option.other].area, 6),
                        "transform": option.transform.tolist(),
                    }
                    for option in options.get(number, [])
                ],
            }
            for number, piece in enumerate(pieces)
        ],
    }


def _production(grammar: ShapeGrammar, production: Production) -> dict[str, Any]:
    return {
        "name": production.name,
        "site": production.site,
        "frame": production.frame.tolist(),
        "non_terminals": [
            {
                "site": non_terminal.site,
                "name": site_name(non_terminal.site),
                "frame": non_terminal.frame.tolist(),
                "original": format_derivation(grammar, non_terminal.original),
                "tree": _tree(non_terminal.original),
            }
            for non_terminal in production.non_terminals
        ],
    }


def _grid(grid: Grid) -> dict[str, Any]:
    return {
        "name": grid.name,
        "rows": [
            {
                "site": site,
                "name": site_name(site),
                "cells": count,
                "transform": transform.tolist(),
                "frame": frame.tolist(),
            }
            for site, count, transform, frame in zip(grid.sites, grid.counts, grid.transforms, grid.frames, strict=True)
        ],
        "pieces": [{"terminal": mesh, "along": [GRID_PARTS[part] for part in parts]} for mesh, parts in grid.pieces],
    }


def _middle(extracted: ExtractedGrammar, number: int) -> np.ndarray:
    grid = extracted.grid
    cells = grid.cells[extracted.docked_pieces[number].border]
    middle: np.ndarray = grid.origin + (cells.mean(axis=0) + 0.5) * grid.cell_size
    return middle


def _tree(derivation: Derivation) -> list[Any]:
    return [derivation.production, *map(_tree, derivation.parts)]
