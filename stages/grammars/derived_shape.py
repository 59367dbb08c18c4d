"""The shape of a derivation: its terminals at their poses, and a digest of the surface that they make."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.grammars.derivation import Derivation, ResizedGrid, grid_poses
from stages.grammars.derivation_text import parse_derivation
from stages.grammars.grammar import ShapeGrammar
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.kit import Assembly
from stages.shape.shape import Shape

MOMENT_DECIMALS = 5
"""Shapes whose moments agree to so few decimals are the same."""
_POINTS = np.array([np.roll([1 - 2 * a, a, a], k) for a in (0.445948490915965, 0.091576213509771) for k in range(3)])
"""Barycentric points at which polynomials up to the fourth degree are integrated exactly over a triangle."""
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


@dataclass(frozen=True, eq=False)
class PlacedTerminal:
    """A mesh of a grammar, by its index, at a pose (4, 4)."""

    mesh: int
    pose: FloatArray


def placed_terminals(grammar: ShapeGrammar, derivation: Derivation | ResizedGrid) -> list[PlacedTerminal]:
    """Return the terminals of a derivation at their poses."""
    if isinstance(derivation, ResizedGrid):
        grid = grammar.grids[derivation.grid]
        parts = [along for _, along in grid.pieces]
        placed = grid_poses(grid.transforms, grid.counts, parts, derivation.counts)
        meshes = [(grid.pieces[number][0], pose) for number, pose in placed]
        return [PlacedTerminal(mesh, grammar.mesh_pose(mesh, pose)) for mesh, pose in meshes]
    terminals: list[PlacedTerminal] = []
    waiting = [(derivation, np.eye(4))]
    while waiting:
        node, transform = waiting.pop()
        production = grammar.productions[node.production]
        terminals.append(PlacedTerminal(production.terminal, grammar.mesh_pose(production.terminal, transform)))
        for non_terminal, part in zip(reversed(production.non_terminals), reversed(node.parts), strict=True):
            child = grammar.productions[part.production]
            waiting.append((part, transform @ non_terminal.frame @ invert(child.frame)))
    return terminals


def shape_of_derivation_text(grammar: ShapeGrammar, text: str) -> Shape:
    """Return the shape of a text with all meshes of the grammar, so that shapes share what is known of them.

    Raises DerivationError for a text that is no derivation of the grammar.
    """
    terminals = placed_terminals(grammar, parse_derivation(grammar, text))
    return _shape(grammar, terminals, np.arange(len(grammar.meshes)))


def compact_shape_of_text(grammar: ShapeGrammar, text: str) -> Shape:
    """Return the shape of a text with its own meshes alone: all meshes of an extracted grammar can take gigabytes.

    Raises DerivationError for a text that is no derivation of the grammar.
    """
    terminals = placed_terminals(grammar, parse_derivation(grammar, text))
    return _shape(grammar, terminals, np.unique([terminal.mesh for terminal in terminals]))


def _shape(grammar: ShapeGrammar, terminals: Sequence[PlacedTerminal], meshes: np.ndarray) -> Shape:
    """Return the shape of some terminals, with the meshes of these indices, int64 (k,), ascending."""
    types = np.searchsorted(meshes, [terminal.mesh for terminal in terminals]).astype(np.int16)
    poses = np.array([terminal.pose for terminal in terminals])
    chosen = tuple(grammar.meshes[index] for index in meshes.tolist())
    parts = Assembly(types, poses, np.empty((0, 2), np.int32))
    return Shape(chosen, parts, grammar.up, grammar.labels, one_surface=True, unit=grammar.unit)


def exemplar_shape(grammar: ShapeGrammar) -> Shape:
    """Return the exemplar as a shape of one part."""
    alone = Assembly(np.zeros(1, dtype=np.int16), np.eye(4)[None], np.empty((0, 2), np.int32))
    return Shape((grammar.exemplar,), alone, grammar.up, (grammar.exemplar.name,), one_surface=True, unit=grammar.unit)


def surface_digest(grammar: ShapeGrammar, terminals: Sequence[PlacedTerminal]) -> str:
    """Return a hex digest of the surface that terminals make.

    Shapes that a rigid transform or a mirror maps to each other have the same digest, however they are cut. It is
    computed from the area and moments up to the fourth, which are sums over triangles.
    """
    corners = np.concatenate(
        [
            transform_points(terminal.pose, grammar.meshes[terminal.mesh].vertices)[grammar.meshes[terminal.mesh].faces]
            for terminal in terminals
        ]
    )
    areas = triangle_areas(corners)
    area = float(areas.sum())
    weight = (areas[:, None] * _WEIGHTS).reshape(-1) / area
    points = np.einsum("qk,tkd->tqd", _POINTS, corners).reshape(-1, 3)
    points = (points - weight @ points) / np.sqrt(area)
    squared = (points**2).sum(axis=1)
    exemplar = grammar.exemplar.vertices[grammar.exemplar.faces]
    moments = [
        area / triangle_areas(exemplar).sum(),
        *np.linalg.eigvalsh((points * weight[:, None]).T @ points),
        float(np.linalg.norm(weight * squared @ points)),
        float(weight @ squared**2),
    ]
    rounded = [f"{moment + 0.0:.{MOMENT_DECIMALS}f}" for moment in moments]
    return hashlib.sha256(" ".join(rounded).encode()).hexdigest()
