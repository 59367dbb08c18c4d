"""The time to extract a grammar from a scan, with the grammar of the scanned mesh for comparison (symmetry §5)."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections import Counter
from collections.abc import Iterator

import numpy as np

from stages.grammars.extraction.extract import ExtractedGrammar, SurfaceMesh, extract_grammar
from stages.grammars.scans.scanned_grid import ScannedCloud
from tests.bench.measure import Measure
from tests.stages.grammars.scanned import scanned
from tests.stages.symmetry.planted import mesh, wall

SIMILARITY_RADIUS = 0.016
CLOUD_POINTS = 1_200_000
NOISE_CELLS = 0.2
"""Standard deviation of the noise."""
HOLE_COUNT, HOLE_RADIUS_CELLS = 40, 1.5
FACADE_WINDOWS = (5, 4)


def bench() -> Iterator[Measure]:
    """Points per CPU second, on one core, in a separate process.

    The note has the size of the grammar, CPU seconds by step, peak memory, and the size of the mesh's grammar.
    """
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        points, seconds, note = pool.apply(_scan)
    yield Measure("grammar of a scan, facade of 20 windows", "points", points / seconds, note=note)


def _scan() -> tuple[int, float, str]:
    _extracted(_surface(wall(2)), 0.05)
    _extracted(_cloud(wall(3), 30_000, 0.05), 0.05)  # compile
    exact = _extracted(_surface(wall(*FACADE_WINDOWS)), SIMILARITY_RADIUS)
    cloud = _cloud(wall(*FACADE_WINDOWS), CLOUD_POINTS, SIMILARITY_RADIUS)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    found = _extracted(cloud, SIMILARITY_RADIUS)
    spent = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    parts = ", ".join(f"{name} {seconds:.1f}" for name, seconds in found.seconds.items())
    return (
        len(cloud.points),
        spent,
        f"{len(cloud.points):,} points in {spent:.1f} s ({parts}); {_size_text(found)}; the mesh: {_size_text(exact)}; "
        f"peak {peak / 1024:.0f} MiB, {before / 1024:.0f} before",
    )


def _size_text(found: ExtractedGrammar) -> str:
    sites = ", ".join(map(str, sorted(Counter(piece.site for piece in found.docked_pieces).values(), reverse=True)))
    grids = ", ".join(" x ".join(map(str, grid.counts)) for grid in found.grammar.grids)
    return (
        f"{len(found.grid):,} cells, {found.transforms} motions, {len(found.docked_pieces)} docked pieces "
        f"({sites} per class), {len(found.grammar.productions)} rules, grids {grids}"
    )


def _extracted(surface: SurfaceMesh | ScannedCloud, radius: float) -> ExtractedGrammar:
    return extract_grammar(surface, "bench", radius, "z", np.random.default_rng(0))


def _surface(triangles: np.ndarray) -> SurfaceMesh:
    vertices, faces = mesh(triangles)
    return SurfaceMesh(vertices, faces, np.full((len(faces), 3), 160, np.uint8))


def _cloud(triangles: np.ndarray, count: int, radius: float) -> ScannedCloud:
    cell = radius / 4 * float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    points, _ = scanned(
        triangles, count, NOISE_CELLS * cell, HOLE_COUNT, HOLE_RADIUS_CELLS * cell, np.random.default_rng(0)
    )
    return ScannedCloud(points, np.full((len(points), 3), 160, np.uint8))
