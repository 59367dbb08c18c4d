"""A grammar as JSON that a person can read: sites, what may dock there, rules, terminals, grids."""

from __future__ import annotations

from typing import Any

import numpy as np

from stages.grammars.derivation import ENDS, Derivation
from stages.grammars.derivation_text import format_derivation
from stages.grammars.editing import editing_options
from stages.grammars.extraction.extract import ExtractedGrammar
from stages.grammars.grammar import Grid, site_name


def describe_grammar(found: ExtractedGrammar) -> dict[str, Any]:
    """All that there is to say of a grammar, with the editing options at each docking site. `tree` and `frame` are what
    programs read: an original as places among the rules, and poses (4, 4)."""
    grammar = found.grammar
    whole = float(found.grid.area.sum())
    options = editing_options(found)
    terminals = [
        {
            "name": each.name,
            grammar.made_of: len(each.faces),
            "size": [round(float(side), 6) for side in np.ptp(each.bounds, axis=0)],
            "middle": middle.tolist(),
        }
        for each, middle in zip(grammar.meshes, grammar.middles, strict=True)
    ]
    return {
        "grammar": grammar.name,
        "up": grammar.up,
        "radius": grammar.radius,
        "made_of": grammar.made_of,
        grammar.made_of: len(grammar.exemplar.faces),
        "area": whole,
        "motions": found.transforms,
        "dockers": len(found.docked_pieces),
        "non_terminals": [
            {
                "name": site_name(site),
                "site": site,
                "dockers": sum(each.site == site for each in found.docked_pieces),
                "rules": [grammar.productions[each].name for each in rules],
            }
            for site, rules in grammar.productions_of_site.items()
        ],
        "rules": [
            {
                "name": each.name,
                "site": each.site,
                "frame": each.frame.tolist(),
                "places": [
                    {
                        "site": place.site,
                        "non_terminal": site_name(place.site),
                        "frame": place.frame.tolist(),
                        "original": format_derivation(grammar, place.original),
                        "tree": _tree(place.original),
                    }
                    for place in each.non_terminals
                ],
            }
            for each in grammar.productions
        ],
        "grids": [_described_grid(each) for each in grammar.grids],
        "terminals": terminals,
        "editing": [
            {
                "docker": place,
                "non_terminal": site_name(docker.site),
                "share": round(docker.area, 6),
                "at": [round(float(each), 6) for each in _middle(found, place)],
                "options": [
                    {
                        "docker": each.other,
                        "kind": each.kind,
                        "share": round(found.docked_pieces[each.other].area, 6),
                        "motion": each.transform.tolist(),
                    }
                    for each in options.get(place, [])
                ],
            }
            for place, docker in enumerate(found.docked_pieces)
        ],
    }


def _middle(found: ExtractedGrammar, docker: int) -> np.ndarray:
    cells = found.docked_pieces[docker].border
    middle: np.ndarray = found.grid.origin + (found.grid.cells[cells].mean(axis=0) + 0.5) * found.grid.cell_size
    return middle


def _described_grid(grid: Grid) -> dict[str, Any]:
    return {
        "name": grid.name,
        "rows": [
            {
                "site": site,
                "non_terminal": site_name(site),
                "cells": count,
                "motion": motion.tolist(),
                "frame": frame.tolist(),
            }
            for site, count, motion, frame in zip(grid.sites, grid.counts, grid.transforms, grid.frames, strict=True)
        ],
        "pieces": [{"terminal": mesh, "along": [ENDS[each] for each in where]} for mesh, where in grid.pieces],
    }


def _tree(made: Derivation) -> list[Any]:
    return [made.production, *map(_tree, made.parts)]
