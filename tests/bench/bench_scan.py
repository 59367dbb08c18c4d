"""The time from a scan to its grammar, beside that of the mesh that was scanned (symmetry §5)."""

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

RADIUS = 0.016
POINTS = 1_200_000
NOISE = 0.2
"""Standard deviation, in cells."""
HOLES, HOLE = 40, 1.5
"""Holes, and their radius in cells."""
FACADE = (5, 4)


def bench() -> Iterator[Measure]:
    """Points a CPU second to a grammar, one core, in a process of its own; the note has what was found, CPU seconds of
    the steps, and peak memory, and what is found in the mesh."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        points, seconds, note = pool.apply(_scan)
    yield Measure("grammar of a scan, facade of 20 windows", "points", points / seconds, note=note)


def _scan() -> tuple[int, float, str]:
    _extracted(_surface(wall(2)), 0.05)
    _extracted(_cloud(wall(3), 30_000, 0.05), 0.05)  # compile what is compiled
    exact = _extracted(_surface(wall(*FACADE)), RADIUS)
    cloud = _cloud(wall(*FACADE), POINTS, RADIUS)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    found = _extracted(cloud, RADIUS)
    spent = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    parts = ", ".join(f"{name} {each:.1f}" for name, each in found.seconds.items())
    return (
        len(cloud.points),
        spent,
        f"{len(cloud.points):,} points in {spent:.1f} s ({parts}); {_told(found)}; the mesh: {_told(exact)}; peak "
        f"{peak / 1024:.0f} MiB, {before / 1024:.0f} before",
    )


def _told(found: ExtractedGrammar) -> str:
    sites = ", ".join(map(str, sorted(Counter(each.site for each in found.docked_pieces).values(), reverse=True)))
    grids = ", ".join(" x ".join(map(str, each.counts)) for each in found.grammar.grids)
    return (
        f"{len(found.grid):,} cells, {found.transforms} motions, {len(found.docked_pieces)} dockers ({sites} a class), "
        f"{len(found.grammar.productions)} rules, grids {grids}"
    )


def _extracted(surface: SurfaceMesh | ScannedCloud, radius: float) -> ExtractedGrammar:
    return extract_grammar(surface, "bench", radius, "z", np.random.default_rng(0))


def _surface(triangles: np.ndarray) -> SurfaceMesh:
    vertices, faces = mesh(triangles)
    return SurfaceMesh(vertices, faces, np.full((len(faces), 3), 160, np.uint8))


def _cloud(triangles: np.ndarray, count: int, radius: float) -> ScannedCloud:
    cell = radius / 4 * float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    points, _ = scanned(triangles, count, NOISE * cell, HOLES, HOLE * cell, np.random.default_rng(0))
    return ScannedCloud(points, np.full((len(points), 3), 160, np.uint8))
