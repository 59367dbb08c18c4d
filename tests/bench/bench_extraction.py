"""Programs extracted a second from hierarchies in memory: aligned parts, and parts whose attachments are searched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES
from stages.shapeassembly.extraction.extract import extract
from stages.shapeassembly.extraction.hierarchy import PartHierarchy
from stages.shapeassembly.extraction.settings import Gates
from tests.bench.measure import Measure, rate
from tests.stages.shapeassembly.extraction.shapes import hierarchy, leaf, table, turned


def chair() -> PartHierarchy:
    """Seven parts; the back leans."""
    axes = turned(0, 12)
    legs = [leaf("leg", (x, -0.4, z), (0.1, 0.7, 0.1)) for x in (-0.4, 0.4) for z in (-0.4, 0.4)]
    arms = [leaf("back", tuple(np.array([x, 0.0, -0.45]) + 0.4 * axes[1]), (0.1, 0.9, 0.1), axes) for x in (-0.4, 0.4)]
    return hierarchy(*legs, leaf("seat", (0, 0, 0), (1, 0.1, 1)), *arms)


def bench() -> Iterator[Measure]:
    """Shapes a second and core, reading not counted. No public tool does the same."""
    for name, shape in (("table of 5 parts", table()), ("chair of 7 parts with a leaning back", chair())):

        def made(shape: PartHierarchy = shape) -> int:
            extract(shape, CATEGORY_RULES["any"], Gates())
            return 1

        yield Measure(f"extraction, {name}", "shapes", rate(made))
