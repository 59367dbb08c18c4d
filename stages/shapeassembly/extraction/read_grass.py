"""Reads the boxes of GRASS shapes from an npz file: flat hierarchies without labels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from pipeline.errors import Rejected
from stages.shapeassembly.extraction.hierarchy import UNREADABLE, Part, PartHierarchy, bounded, box_of_rows

__all__ = ["read_grass"]


def read_grass(path: Path) -> Iterator[PartHierarchy]:
    """Every shape of `path`, named by its place in the file, as a root with one leaf a box.

    The file holds `full_boxes` (n, 12), rows of centre, three lengths and the directions of the first two, with
    symmetric copies, and `full_offsets` (k + 1,), which slice them by shape. Raises Rejected for other contents.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            boxes, offsets = arrays["full_boxes"].astype(np.float64), arrays["full_offsets"].astype(np.int64)
    except (BadZipFile, ValueError, KeyError, EOFError) as error:
        raise Rejected(
            UNREADABLE, f"{path.name}: not a GRASS file with full_boxes and full_offsets ({error})"
        ) from None
    if boxes.ndim != 2 or boxes.shape[1] != 12 or offsets.ndim != 1 or len(offsets) < 2:
        raise Rejected(UNREADABLE, f"{path.name}: full_boxes is (n, 12) and full_offsets is (k + 1,)")
    if offsets[0] < 0 or offsets[-1] > len(boxes) or (np.diff(offsets) <= 0).any():
        raise Rejected(UNREADABLE, f"{path.name}: full_offsets must ascend within the {len(boxes)} rows of full_boxes")
    for index, (start, end) in enumerate(zip(offsets[:-1], offsets[1:], strict=True)):
        name = f"{path.stem}_{index:05d}"
        leaves = tuple(
            Part("part", box_of_rows(*row.reshape(4, 3), place=f"{path.name}, row {place}"))
            for place, row in enumerate(boxes[start:end], start=int(start))
        )
        yield PartHierarchy(name, bounded(Part("root", leaves[0].box, leaves), name))
