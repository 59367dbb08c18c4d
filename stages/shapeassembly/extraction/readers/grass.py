"""Read the boxes of GRASS shapes from an npz file: flat hierarchies without labels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from pipeline.errors import Rejected
from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.hierarchy import (
    UNREADABLE,
    PartHierarchy,
    PartNode,
    box_from_numbers,
    check_limits,
)


@dataclass(frozen=True)
class GrassFile:
    """The shapes of one file.

    boxes: float64 (n, 12), centre, three lengths and the directions of the first two, symmetric copies included.
    offsets: int64 (k + 1,), slices the rows by shape.
    """

    name: str
    boxes: FloatArray
    offsets: np.ndarray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def shape(self, index: int) -> PartHierarchy:
        """Return shape `index`, named by its place in the file: a root with a leaf for each box.

        Raises Rejected, naming the row, for an invalid box.
        """
        name = f"{self.name}_{index:05d}"
        rows = range(int(self.offsets[index]), int(self.offsets[index + 1]))
        leaves = tuple(
            PartNode("part", box_from_numbers(self.boxes[row], f"{self.name}.npz, row {row}")) for row in rows
        )
        return PartHierarchy(name, check_limits(PartNode("root", leaves[0].box, leaves), name))


def read_grass(path: Path) -> GrassFile:
    """Read a file with `full_boxes` and `full_offsets`. Raises Rejected for other contents."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            boxes, offsets = arrays["full_boxes"].astype(np.float64), arrays["full_offsets"].astype(np.int64)
    except (BadZipFile, ValueError, KeyError, EOFError, TypeError):
        raise Rejected(
            UNREADABLE, f"{path.name}: not a whole GRASS file with full_boxes and full_offsets; download it again"
        ) from None
    if boxes.ndim != 2 or boxes.shape[1] != 12 or offsets.ndim != 1 or len(offsets) < 2:
        raise Rejected(UNREADABLE, f"{path.name}: full_boxes is (n, 12) and full_offsets is (k + 1,)")
    if offsets[0] < 0 or offsets[-1] > len(boxes) or (np.diff(offsets) <= 0).any():
        raise Rejected(UNREADABLE, f"{path.name}: full_offsets must ascend within the {len(boxes)} rows of full_boxes")
    return GrassFile(path.stem, boxes, offsets)
