"""Hierarchies read in a process of their own, which may take so much and no more: a file may be anybody's."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.bounded import ChildFailed, in_child
from pipeline.errors import Rejected
from stages.shapeassembly.extraction.hierarchy import UNREADABLE, Box, PartHierarchy, PartNode
from stages.shapeassembly.extraction.readers.grass import GrassFile, read_grass

MAX_CPU_SECONDS = 120
MAX_MEMORY_MB = 4000


def read_in_child(read: Callable[[Path], PartHierarchy], path: Path) -> PartHierarchy:
    """What `read` makes of the file `path`, in a child process. Raises Rejected, naming the file, where `read` does,
    and for a file that takes more than it may."""
    said = json.loads(_content(lambda: json.dumps(_said(read(path))).encode(), path))
    return PartHierarchy(said["name"], _part(said["root"]))


def read_grass_in_child(path: Path) -> GrassFile:
    """`read_grass`, in a child process. Raises Rejected as it does, and for a file that takes more than it may."""

    def arrays() -> bytes:
        found = read_grass(path)
        stream = io.BytesIO()
        np.savez(stream, boxes=found.boxes, offsets=found.offsets)
        return stream.getvalue()

    with np.load(io.BytesIO(_content(arrays, path)), allow_pickle=False) as stored:
        return GrassFile(path.stem, stored["boxes"], stored["offsets"])


class _Refused(Exception):
    """What a reader rejects, on its way out of the child."""


def _content(work: Callable[[], bytes], path: Path) -> bytes:
    def told() -> bytes:
        try:
            return work()
        except Rejected as error:
            raise _Refused(json.dumps([error.reason, error.detail])) from None

    try:
        return in_child(told, cpu_seconds=MAX_CPU_SECONDS, memory_mb=MAX_MEMORY_MB, refusal=_Refused)
    except _Refused as error:
        raise Rejected(*json.loads(str(error))) from None
    except ChildFailed as error:
        raise Rejected(UNREADABLE, f"{path.name}: cannot be read: {error}; export it again, simpler") from None


def _said(hierarchy: PartHierarchy) -> dict[str, Any]:
    def part(each: PartNode) -> list[Any]:
        box = each.box
        return [each.label, box.center.tolist(), box.size.tolist(), box.axes.tolist(), [*map(part, each.children)]]

    return {"name": hierarchy.name, "root": part(hierarchy.root)}


def _part(said: list[Any]) -> PartNode:
    label, center, size, axes, children = said
    return PartNode(label, Box(np.array(center), np.array(size), np.array(axes)), tuple(map(_part, children)))
