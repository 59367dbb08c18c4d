"""Meshes of all building blocks by name, for tests that hold for all of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stages.programs.curves import (
    Curve,
    Profile,
    QuadMesh,
    Style,
    arc,
    bend,
    bezier,
    box,
    circle,
    cylinder,
    ellipsoid,
    extrude,
    follow,
    helix,
    hollow,
    line,
    loft,
    mirroring,
    polygon,
    polyline,
    rectangle,
    revolve,
    rounded_box,
    rounded_rectangle,
    solidify,
    spiral,
    square_circle,
    sweep,
    taper,
    twist,
)

STAR = Profile.of([(np.cos(k * np.pi / 5) * r, np.sin(k * np.pi / 5) * r) for k, r in enumerate([1.0, 0.4] * 5)])
ELL = Profile.of([(0, 0), (1, 0), (1, 0.3), (0.3, 0.3), (0.3, 1), (0, 1)])
DESIGN: Curve = bezier([(0.2, 0), (0.6, 0.2), (0.4, 0.8), (0.1, 0.8), (0.05, 0.9), (0.15, 1.0), (0.2, 1.1)], 10)
UPRIGHT = line((0, 0, 0), (0, 1, 0))
BENT = bezier([(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 2, 0.5)], 15)


def wavy_grid() -> np.ndarray:
    """A sheet of 8 x 6 points with a wave."""
    x, y = np.meshgrid(np.linspace(0, 1, 8), np.linspace(0, 1, 6), indexing="ij")
    return np.stack([x, y, 0.2 * np.sin(3 * x)], axis=-1)


def shade() -> np.ndarray:
    """A lampshade, rows around the y axis, columns from the top down."""
    t = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rings = [np.stack([np.cos(t) * r, np.full(16, h), -np.sin(t) * r], axis=1) for r, h in ((0.3, 0.3), (0.5, 0.0))]
    return np.stack(rings, axis=1)


def bar() -> QuadMesh:
    return sweep(polyline([(x, 0, 0) for x in np.linspace(0, 1, 20)]), rectangle(0.1, 0.05))


BLOCKS: dict[str, Callable[[], QuadMesh]] = {
    "leg": lambda: sweep(UPRIGHT, square_circle(0.5, 0.2, 0.1)),
    "pill": lambda: sweep(line((0, 0, 0), (1, 0, 0)), circle(0.1), caps="round"),
    "half pill": lambda: sweep(line((0, 0, 0), (1, 0, 0)), rectangle(0.1, 0.2), caps=("flat", "round")),
    "horn": lambda: sweep(BENT, circle(0.1, 12), Style.taper(1, 0, twist=90, count=6)),
    "spindle": lambda: sweep(UPRIGHT, circle(0.1), Style.knots([(0, 0), (0.4, 1), (1, 0)], smooth=True)),
    "gate": lambda: sweep(polyline([(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)]), rectangle(0.1, 0.2)),
    "picture frame": lambda: sweep(polyline([(0, 0), (0, 1), (1, 1), (1, 0)], closed=True), rectangle(0.1, 0.2)),
    "spring": lambda: sweep(helix(0.5, 1, 3), circle(0.05)),
    "left spring": lambda: sweep(helix(0.5, 1, -3), circle(0.05)),
    "spiral": lambda: sweep(spiral(0.1, 0.5, 3), circle(0.03), caps=("round", "flat")),
    "moebius": lambda: sweep(arc(0.5), circle(0.1), Style.taper((1, 0.5), (1, 0.5), twist=360, count=24)),
    "odd tube": lambda: sweep(BENT, polygon(7, 0.1)),
    "prism": lambda: sweep(BENT, polygon(3, 0.1)),
    "star tube": lambda: sweep(BENT, STAR.scaled(0.1)),
    "angle iron": lambda: sweep(BENT, ELL.scaled(0.1)),
    "loft": lambda: loft(UPRIGHT, [(0, square_circle(0)), (0.5, square_circle(0.5, 0.5)), (1, square_circle(1))]),
    "star board": lambda: extrude(STAR, 0.3, bevel=0.05),
    "rounded ell": lambda: extrude(ELL, 0.3, axis="x", bevel=0.05, steps=3),
    "board x": lambda: extrude(square_circle(0.3), 0.2, axis="x"),
    "board y": lambda: extrude(square_circle(0.3), 0.2, axis="y"),
    "board z": lambda: extrude(rounded_rectangle(2, 1, 0.3), 0.2, axis="z"),
    "stadium": lambda: extrude(rounded_rectangle(2, 1, 0.5), 0.2),
    "vase body": lambda: revolve(DESIGN),
    "vase body drawn downwards": lambda: revolve(DESIGN.reversed()),
    "vase": lambda: revolve(hollow(DESIGN, 0.03)),
    "piece of body": lambda: revolve(DESIGN, 120),
    "piece of vase": lambda: revolve(hollow(DESIGN, 0.03), 200),
    "ring": lambda: revolve(circle(0.1).translated(0.5, 0).curve("z")),
    "bend of a pipe": lambda: revolve(circle(0.1).translated(0.5, 0).curve("z"), 90),
    "bend of an ell": lambda: revolve(ELL.translated(0.5, 0).curve("z"), 90),
    "ball": lambda: ellipsoid((0.5, 0.3, 0.2)),
    "cylinder": lambda: cylinder(0.3, 1),
    "cone": lambda: cylinder(0.3, 1, 0),
    "box": lambda: box((1, 2, 3), (5, 5, 5)),
    "rounded box": lambda: rounded_box((1, 0.5, 0.7), 0.1),
    "bevelled box": lambda: rounded_box((1, 0.5, 0.7), 0.1, steps=1),
    "fully rounded box": lambda: rounded_box((1, 0.5, 0.7), 0.25),
    "seat shell": lambda: solidify(wavy_grid(), 0.05),
    "shade": lambda: solidify(shade(), 0.04, closed=True),
    "mirrored horn": lambda: BLOCKS["horn"]().transformed(mirroring("x")),
    "bent bar": lambda: bar().deformed(bend("x", "y", 90)),
    "twisted bar": lambda: bar().deformed(twist("x", 90)),
    "tapered bar": lambda: bar().deformed(taper("x", 1, 0.2)),
    "bar along an arc": lambda: bar().deformed(follow(arc(1, 0, 120), "x")),
    "two": lambda: QuadMesh.joined([BLOCKS["box"](), BLOCKS["cone"]()]),
}
