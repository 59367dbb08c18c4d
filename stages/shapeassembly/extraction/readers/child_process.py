"""Read hierarchies in a child process with limited resources: files may come from anybody."""

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
    """Read a file in a child process.

    Raises Rejected, naming the file, where `read` does, and for a file that exceeds the limits.
    """
    tree = json.loads(_content(lambda: json.dumps(_as_json(read(path))).encode(), path))
    return PartHierarchy(tree["name"], _part(tree["root"]))


def read_grass_in_child(path: Path) -> GrassFile:
    """Run `read_grass` in a child process. Raises Rejected as it does, and for a file that exceeds the limits."""

    def arrays() -> bytes:
        file = read_grass(path)
        stream = io.BytesIO()
        np.savez(stream, boxes=file.boxes, offsets=file.offsets)
        return stream.getvalue()

    with np.load(io.BytesIO(_content(arrays, path)), allow_pickle=False) as stored:
        return GrassFile(path.stem, stored["boxes"], stored["offsets"])


class _ChildRejected(Exception):
    """A rejection of a reader, on its way out of the child."""


def _content(work: Callable[[], bytes], path: Path) -> bytes:
    def run() -> bytes:
        try:
            return work()
        except Rejected as error:
            raise _ChildRejected(json.dumps([error.reason, error.detail])) from None

    try:
        return in_child(run, cpu_seconds=MAX_CPU_SECONDS, memory_mb=MAX_MEMORY_MB, refusal=_ChildRejected)
    except _ChildRejected as error:
        raise Rejected(*json.loads(str(error))) from None
    except ChildFailed as error:
        raise Rejected(UNREADABLE, f"{path.name}: cannot be read: {error}; export it again, simpler") from None


def _as_json(hierarchy: PartHierarchy) -> dict[str, Any]:
    def part(node: PartNode) -> list[Any]:
        box = node.box
        return [node.label, box.center.tolist(), box.size.tolist(), box.axes.tolist(), [*map(part, node.children)]]

    return {"name": hierarchy.name, "root": part(hierarchy.root)}


def _part(fields: list[Any]) -> PartNode:
    label, center, size, axes, children = fields
    return PartNode(label, Box(np.array(center), np.array(size), np.array(axes)), tuple(map(_part, children)))
