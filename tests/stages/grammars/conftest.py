"""Fixtures of all tests of grammars: a wall of four windows, cut once."""

from __future__ import annotations

import numpy as np
import pytest

from stages.grammars.collisions import Collisions
from stages.grammars.extraction.extract import ExtractedGrammar, SurfaceMesh, extract_grammar
from stages.grammars.grammar import ShapeGrammar
from tests.stages.symmetry.planted import mesh, wall


@pytest.fixture(scope="session")
def found() -> ExtractedGrammar:
    """Extract the grammar of a wall of four windows."""
    vertices, faces = mesh(wall(4))
    colors = np.full((len(faces), 3), 160, np.uint8)
    return extract_grammar(SurfaceMesh(vertices, faces, colors, "metre"), "wall", 0.03, "z", np.random.default_rng(0))


@pytest.fixture(scope="session")
def grammar(found: ExtractedGrammar) -> ShapeGrammar:
    return found.grammar


@pytest.fixture(scope="session")
def collisions(grammar: ShapeGrammar) -> Collisions:
    return Collisions(grammar)
