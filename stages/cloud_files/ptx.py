"""PTX, the text of laser scanners: scans one after another, each a grid of points with a transform."""

from __future__ import annotations

import numpy as np

from stages.cloud_files.cloud import PointCloud
from stages.cloud_files.number_table import InvalidTable
from stages.shape.input_file import decode_text

_HEADER_LINES = 10
"""Columns, rows, position (1 line), axes (3), matrix (4)."""
MAX_COUNT_DIGITS = 9


def read_ptx(content: bytes) -> PointCloud:
    """Return the points of all scans in one frame, without the directions that hit nothing. Raises InvalidTable."""
    lines = decode_text(content).splitlines()
    at, clouds, missed = 0, [], 0
    while any(line.strip() for line in lines[at:]):
        header = lines[at : at + _HEADER_LINES]
        if len(header) < _HEADER_LINES or not all(
            line.strip().isdecimal() and len(line.strip()) <= MAX_COUNT_DIGITS for line in header[:2]
        ):
            raise InvalidTable(f"line {at + 1}: a PTX scan begins with its columns and rows; export it again")
        count = int(header[0]) * int(header[1])
        rows = lines[at + _HEADER_LINES : at + _HEADER_LINES + count]
        if len(rows) < count:
            raise InvalidTable(
                f"line {at + 1} announces {count:,} points and {len(rows):,} follow; copy or export the file again"
            )
        try:
            matrix = np.loadtxt(header[6:], comments=None, ndmin=2)
            points = np.loadtxt(rows, comments=None, ndmin=2, usecols=(0, 1, 2)) if count else np.empty((0, 3))
        except ValueError:
            raise InvalidTable(
                f"the scan of line {at + 1} has a line that is not made of numbers; export it again"
            ) from None
        if matrix.shape != (4, 4) or len(points) != count:
            raise InvalidTable(f"the scan of line {at + 1} has an invalid transform or blank lines; export it again")
        hit = (points != 0.0).any(axis=1)
        missed += count - int(hit.sum())
        clouds.append(points[hit] @ matrix[:3, :3] + matrix[3, :3])
        at += _HEADER_LINES + count
    warnings = (f"{missed:,} directions of the scanner hit nothing and are no points",) if missed else ()
    return PointCloud(np.concatenate(clouds) if clouds else np.empty((0, 3)), warnings=warnings)
