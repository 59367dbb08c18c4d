"""Swept, revolved and exported meshes per second; the peer: trimesh on the same curves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.programs.curves import (
    Part,
    QuadMesh,
    Style,
    arc,
    bezier,
    circle,
    line,
    mesh_defects,
    revolve,
    square_circle,
    sweep,
)
from tests.bench.measure import Measure, rate

CONTROLS = [(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 2, 0.5)]
OUTLINE = [(0.2, 0), (0.6, 0.2), (0.4, 0.8), (0.1, 0.8), (0.05, 0.9), (0.15, 1.0), (0.2, 1.1)]


def bench() -> Iterator[Measure]:
    """Meshes per second and core, made from parameters. trimesh sweeps with shapely alone, but turns its torus."""
    import trimesh

    outline = np.concatenate([[[0.0, 0.0]], bezier(OUTLINE, 10).points[:, :2], [[0.0, 1.1]]])
    style = Style.taper(1.0, 0.5)
    horn = sweep(bezier(CONTROLS, 15), circle(0.1, 12))

    def torus() -> int:
        return int(len(sweep(arc(0.5, count=16), circle(0.1, 12)).triangles) == 384)

    def torus_trimesh() -> int:
        return int(len(trimesh.creation.torus(0.5, 0.1, 16, 12).faces) == 384)

    def revolved() -> int:
        return int(len(revolve(bezier(OUTLINE, 10), count=24).triangles) > 0)

    def revolved_trimesh() -> int:
        return int(len(trimesh.creation.revolve(outline, sections=24).faces) > 0)

    def bent() -> int:
        return int(len(sweep(bezier(CONTROLS, 15), circle(0.1, 12)).quads) > 0)

    def leg() -> int:
        rail = line((0.2, 0.0, 0.2), (0.15, 0.45, 0.15))
        mesh = sweep(rail, square_circle(0.4, 0.04, 0.05), style, up=(0, 0, 1))
        return int(len(Part("leg", mesh, (150, 105, 70)).part_mesh().faces) > 0)

    def checked() -> int:
        return int(mesh_defects(QuadMesh(horn.vertices, horn.quads)) == [])

    def checked_trimesh() -> int:
        return int(trimesh.Trimesh(horn.vertices, horn.triangles, process=False).is_volume)

    ours = rate(torus, 0.5)
    yield Measure("programs, torus of 16 x 12 points", "meshes", ours, "trimesh", rate(torus_trimesh, 0.5))
    ours = rate(revolved, 0.5)
    yield Measure("programs, vase body of 21 x 24 points", "meshes", ours, "trimesh", rate(revolved_trimesh, 0.5))
    ours, note = (
        rate(checked, 0.5),
        "ours also finds thin and folded faces and touching vertices",
    )
    yield Measure("programs, check of 218 faces", "meshes", ours, "trimesh is_volume", rate(checked_trimesh, 0.5), note)
    yield Measure("programs, Bezier rail swept, 16 x 12 points", "meshes", rate(bent, 0.5))
    yield Measure("programs, tapered leg to labelled triangles", "parts", rate(leg, 0.5))
