"""Curve building blocks of shape programs (geocode §3.1).

A shape element is a triplet: a `Curve` (where it runs), a `Profile` (its cross-section) and a `Style` (its width along
the curve). `sweep` makes a mesh of it. Elements are attached to each other at relative positions along curves. A stool:

    import numpy as np
    from stages.programs.curves import *

    WOOD, CLOTH = (150, 105, 70), (70, 90, 120)

    def stool(height: float, roundness: float, splay: float) -> list[Part]:
        plan = square_circle(roundness, 0.5, 0.5, count=24)
        seat = Part("seat", extrude(plan, 0.05, base=height, bevel=0.02, steps=3), CLOTH)
        top = plan.scaled(0.8).curve("y", height).at(0.0)             # a corner of the seat, a little inside
        foot = top * [1 + splay, 0, 1 + splay]
        rail = line(foot, top)
        leg = Part("leg", sweep(rail, circle(0.025), Style.taper(0.6, 1.0), up=(0, 0, 1)), WOOD)
        legs = radial([leg], 4)                                       # labels and colours are kept
        ends = [rail.at(0.4), rail.at(0.4) * [-1, 1, 1]]              # a rung, two fifths up the legs
        rung = Part("rung", sweep(line(*ends), square_circle(0.5, 0.02)), WOOD)
        return [seat, *legs, *radial([rung], 4)]

    assert not any(mesh_defects(part.mesh) for part in stool(0.45, 0.6, 0.2))
    meshes = [part.part_mesh() for part in stool(0.45, 0.6, 0.2)]     # triangles, for export

Conventions: y is up, +z the front, lengths in units of about a shape's size, angles in degrees, counter-clockwise seen
from the tip of their axis. All values are immutable; every function returns a new one. Degenerate input raises
ValueError with a remedy.

    where it runs    line polyline bezier arc helix spiral chain; Curve.at .tangents .frames .position_where .part
    cross-section    square_circle superellipse circle rectangle rounded_rectangle polygon Profile.of; .curve .inset
    along the way    Style.taper Style.knots Style.of
    to a mesh        sweep loft loft_rings revolve (with hollow) extrude solidify box rounded_box cylinder ellipsoid
    placing          attach stretch frame translation rotation scaling mirroring; x.transformed(matrix)
    copies           symmetric radial linear copies evenly
    deformation      mesh.deformed(function), with bend taper twist follow
    parts            Part joined; mesh_defects lists the defects of a mesh
"""

from __future__ import annotations

from stages.programs.curves.curve import Axis, Curve
from stages.programs.curves.deform import Deformation, bend, follow, taper, twist
from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.mesh_defects import mesh_defects
from stages.programs.curves.part import Part, joined
from stages.programs.curves.paths import arc, bezier, chain, helix, line, polyline, spiral
from stages.programs.curves.patterns import copies, evenly, linear, radial, symmetric
from stages.programs.curves.profile import (
    Profile,
    circle,
    polygon,
    rectangle,
    rounded_rectangle,
    square_circle,
    superellipse,
)
from stages.programs.curves.revolve import hollow, revolve
from stages.programs.curves.shell import solidify
from stages.programs.curves.solids import box, cylinder, ellipsoid, extrude, rounded_box
from stages.programs.curves.style import Style
from stages.programs.curves.sweep import loft, loft_rings, sweep
from stages.programs.curves.transforms import attach, frame, mirroring, rotation, scaling, stretch, translation

__all__ = [
    "Axis",
    "Curve",
    "Deformation",
    "Part",
    "Profile",
    "QuadMesh",
    "Style",
    "arc",
    "attach",
    "bend",
    "bezier",
    "box",
    "chain",
    "circle",
    "copies",
    "cylinder",
    "ellipsoid",
    "evenly",
    "extrude",
    "follow",
    "frame",
    "helix",
    "hollow",
    "joined",
    "line",
    "linear",
    "loft",
    "loft_rings",
    "mesh_defects",
    "mirroring",
    "polygon",
    "polyline",
    "radial",
    "rectangle",
    "revolve",
    "rotation",
    "rounded_box",
    "rounded_rectangle",
    "scaling",
    "solidify",
    "spiral",
    "square_circle",
    "stretch",
    "superellipse",
    "sweep",
    "symmetric",
    "taper",
    "translation",
    "twist",
]
