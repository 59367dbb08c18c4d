"""Read part hierarchies in StructureNet's JSON: nested `{"label", "box": [12 numbers], "children"}`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from stages.shapeassembly.extraction.hierarchy import (
    MAX_HIERARCHY_DEPTH,
    UNREADABLE,
    PartHierarchy,
    PartNode,
    box_from_numbers,
    check_limits,
)


def read_structurenet(path: Path) -> PartHierarchy:
    """Return the hierarchy of a StructureNet file; a box is centre, size, x axis, y axis.

    Relations (`edges`) are not read: contacts and symmetries are found in the geometry (shapeassembly App. C). Raises
    Rejected, naming file and part, for an invalid hierarchy.
    """
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise Rejected(UNREADABLE, f"{path.name}: not JSON ({type(error).__name__}); export it again") from None
    return PartHierarchy(path.stem, check_limits(_part(tree, path.name, 0), path.name))


def _part(node: Any, location: str, depth: int) -> PartNode:
    if depth > MAX_HIERARCHY_DEPTH:
        raise Rejected(UNREADABLE, f"{location}: more than {MAX_HIERARCHY_DEPTH} levels; simplify it")
    if not isinstance(node, dict):
        raise Rejected(UNREADABLE, f"{location}: a part is an object with `label`, `box` and `children`")
    label = node.get("label")
    if not isinstance(label, str) or not label:
        raise Rejected(UNREADABLE, f"{location}: a part has no `label`; name it")
    here = f"{location}/{label}" if depth else location
    numbers = node.get("box")
    if not isinstance(numbers, list) or len(numbers) != 12:
        raise Rejected(UNREADABLE, f"{here}: `box` is a list of twelve numbers: centre, size, x axis, y axis")
    if not all(isinstance(number, int | float) for number in numbers):
        raise Rejected(UNREADABLE, f"{here}: `box` holds something that is no number")
    children = node.get("children") or []
    if not isinstance(children, list):
        raise Rejected(UNREADABLE, f"{here}: `children` is a list of parts")
    box = box_from_numbers(np.array(numbers, dtype=np.float64), here)
    return PartNode(label, box, tuple(_part(child, here, depth + 1) for child in children))
