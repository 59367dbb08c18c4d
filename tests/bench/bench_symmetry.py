"""The time to extract a grammar, by count of triangles: subdivided facades, merged kits and models (symmetry §5)."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from stages.exemplars.read import read_parts
from stages.grammars.extraction.extract import SurfaceMesh, extract_grammar, model_surface
from stages.shape.arrays import FloatArray
from stages.symmetry.surface.welding import weld
from tests.bench.measure import Measure
from tests.stages.symmetry.planted import wall

SIMILARITY_RADIUS = 0.016
MIN_TRIANGLES = 250_000
SUBDIVISION_STEPS = 6
SHIPPED_MODELS = Path("datasets/exemplars/castle")
REAL_MODELS = Path("../shared/exemplars")


def bench() -> Iterator[Measure]:
    """Triangles per CPU second, on one core, in a separate process.

    The note has the size of the grammar, CPU seconds by step, and peak memory; for the facade also seconds by size.
    """
    seconds = {}
    for steps in range(SUBDIVISION_STEPS):
        found = _alone(partial(_facade, steps))
        seconds[found[0]] = found[1]
    yield _measure("facade of 20 windows", found, "; ".join(f"{n:,}: {took:.3g} s" for n, took in seconds.items()))
    for path in (*sorted(SHIPPED_MODELS.glob("*.glb"))[:1], *sorted(REAL_MODELS.glob("u0[16]*/model.*"))):
        yield _measure(f"{path.parent.name}, subdivided", _alone(partial(_subdivided, path)))


def split(corners: FloatArray) -> FloatArray:
    """Split triangles (f, 3, 3) into four (4 f, 3, 3)."""
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    tips = [np.stack([corners[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)]
    return np.concatenate([*tips, middles])


def _facade(steps: int) -> tuple[SurfaceMesh, str]:
    triangles = wall(5, 4)
    for _ in range(steps):
        triangles = split(triangles)
    return _grey(triangles), "z"


def _subdivided(path: Path) -> tuple[SurfaceMesh, str]:
    model = read_parts(path, "components")
    triangles = model_surface(model).corners
    while len(triangles) < MIN_TRIANGLES:
        triangles = split(triangles)
    return _grey(triangles), model.up or "y"


def _grey(triangles: FloatArray) -> SurfaceMesh:
    faces, vertices = weld(triangles, 0.0)
    return SurfaceMesh(vertices, faces, np.full((len(faces), 3), 160, np.uint8))


Found = tuple[int, float, str]


def _alone(made: Callable[[], tuple[SurfaceMesh, str]]) -> Found:
    """Return triangles, CPU seconds and a note of the grammar of a mesh, in a separate process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_grammar, (made,))


def _grammar(made: Callable[[], tuple[SurfaceMesh, str]]) -> Found:
    small = _grey(wall(2))
    extract_grammar(small, "warm", 0.05, "z", np.random.default_rng(0))
    source, up = made()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    found = extract_grammar(source, "bench", SIMILARITY_RADIUS, "z" if up == "z" else "y", np.random.default_rng(0))
    spent = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    parts = ", ".join(f"{name} {took:.1f}" for name, took in found.seconds.items())
    note = (
        f"{len(source.faces):,} triangles in {spent:.1f} s ({parts}); {len(found.grid):,} cells, {found.transforms} "
        f"transforms, {len(found.docked_pieces)} docked pieces, {len(found.grammar.productions)} productions, "
        f"{len(found.grammar.grids)} grids; "
        f"peak {peak / 1024:.0f} MiB, {before / 1024:.0f} before"
    )
    return len(source.faces), spent, note


def _measure(name: str, found: Found, more: str = "") -> Measure:
    triangles, seconds, note = found
    return Measure(
        f"grammar of a mesh, {name}", "triangles", triangles / seconds, note="; ".join(filter(None, [note, more]))
    )
