"""Which columns of a table are coordinates, normals and colours: by their names, else by convention."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from stages.cloud_files.cloud import PointCloud, color_bytes_of
from stages.cloud_files.number_table import InvalidTable, NumberTable
from stages.shape.arrays import FloatArray

MAX_UNIT_DEVIATION = 0.02
"""Largest deviation of a normal's length from 1."""
MIN_UNIT_SHARE = 0.95
"""Share of the rows that must be unit vectors, or zero, for columns to be normals."""

_PREFIX = r"(?:points?|pos(?:ition)?s?|coord(?:inate)?s?|vert(?:ex|ices)?|loc(?:ation)?|center|centroid|xyz|p|v)?"
_SUFFIX = r"(?:coord(?:inate)?s?|pos(?:ition)?|axis|value|m|mm|cm|metres?|meters?)?"
_AXIS = re.compile(rf"{_PREFIX}([xyz])(?:{_SUFFIX})")
_NUMBERED_AXIS = re.compile(r"(?:points?|positions?|pos|coords?|coordinates?|xyz|vertex)([012])")
_NORMAL = re.compile(r"(?:n|normals?|norm|vn)([xyz012])|([xyz])(?:n|normal)")
_COLOR = re.compile(r"(?:diffuse|colou?rs?|vertex|rgb|c)?(r|g|b|red|green|blue)(?:f|diffuse|colou?r|channel)?")
_GEODETIC = re.compile(r"(?:x|y)?(lat|latitude|lon|lng|long|longitude)(?:deg|degrees)?|breite|breitengrad|laengengrad")
_PROJECTED = ({"easting", "east", "e", "ostwert", "rechtswert"}, {"northing", "north", "n", "nordwert", "hochwert"})
_HEIGHT = {"z", "elevation", "elev", "height", "h", "altitude", "alt", "hoehe", "höhe"}
_DIGITS = {"0": "x", "1": "y", "2": "z"}

AXES, NORMALS, COLORS = ("x", "y", "z"), ("nx", "ny", "nz"), ("red", "green", "blue")


def named_columns(names: Sequence[str]) -> tuple[int, ...]:
    """Return the columns of coordinates, then of normals and of colours, by their names; empty without coordinates.

    Raises InvalidTable for angles in place of coordinates.
    """
    roles = _roles(names)
    if not all(axis in roles for axis in AXES):
        plain = [_plain(name) for name in names]
        if len(names) >= 2 and sum(_GEODETIC.fullmatch(name) is not None for name in plain) >= 2:
            raise InvalidTable(
                f"the header names {', '.join(names[:4])}: angles are no coordinates; project the points to metres"
            )
        return ()
    groups = [group for group in (AXES, NORMALS, COLORS) if all(role in roles for role in group)]
    return tuple(roles[role] for group in groups for role in group)


def cloud_of_table(table: NumberTable, suffix: str) -> PointCloud:
    """Return the cloud in a table; columns without names go by convention, with a warning.

    suffix: of the file, in lower case; `.xyzn` and `.xyzrgb` state their columns. Raises InvalidTable for fewer than
    three columns.
    """
    if table.names:
        return _named_cloud(table)
    rows, warnings = table.rows, list(table.warnings)
    if rows.shape[1] > 3 and _counts_rows(rows[:, 0]):
        rows = rows[:, 1:]
        warnings.append("column 1 counts the rows and is no coordinate")
    if rows.shape[1] < 3:
        raise InvalidTable(f"{rows.shape[1]} numbers a line; a point has 3: x, y and z")
    points, further = np.ascontiguousarray(rows[:, :3]), rows[:, 3:]
    if suffix in (".xyzn", ".xyzrgb") and further.shape[1] < 3:
        raise InvalidTable(f"{rows.shape[1]} numbers a line; a line of {suffix} has 6 at least")
    if suffix == ".xyzn":
        return PointCloud(points, further[:, :3], None, tuple(warnings))
    if suffix == ".xyzrgb":
        return PointCloud(points, None, color_bytes_of(further[:, :3]), tuple(warnings))
    first = table.columns[0] + 4 + (table.rows.shape[1] - rows.shape[1])
    normals, colors = _by_convention(further, first, warnings)
    return PointCloud(points, normals, colors, tuple(warnings))


def _named_cloud(table: NumberTable) -> PointCloud:
    roles = _roles(table.names)
    values = {
        group: np.ascontiguousarray(table.rows[:, [roles[role] for role in group]])
        for group in (AXES, NORMALS, COLORS)
        if all(role in roles for role in group)
    }
    colors = color_bytes_of(values[COLORS]) if COLORS in values else None
    return PointCloud(values[AXES], values.get(NORMALS), colors, table.warnings)


def _by_convention(columns: FloatArray, first: int, warnings: list[str]) -> tuple[FloatArray | None, np.ndarray | None]:
    """Return normals and colours among columns without names; `first` is the number of the first of them."""
    normals, colors = None, None
    at = 0
    while at < columns.shape[1]:
        triple = columns[:, at : at + 3]
        where = f"columns {first + at} to {first + at + 2}"
        if normals is None and triple.shape[1] == 3 and _are_normals(triple):
            normals = np.ascontiguousarray(triple)
            warnings.append(f"{where} have no names and are unit vectors: taken for normals")
            at += 3
        elif colors is None and triple.shape[1] == 3 and _are_colors(triple):
            colors = color_bytes_of(triple)
            warnings.append(f"{where} have no names and are from 0 to {triple.max():g}: taken for colours")
            at += 3
        else:
            warnings.append(f"column {first + at} has no name and was left out")
            at += 1
    return normals, colors


def _are_normals(columns: FloatArray) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(columns, axis=1)
    unit = np.abs(lengths - 1.0) <= MAX_UNIT_DEVIATION
    return bool((unit | (lengths == 0.0)).mean() >= MIN_UNIT_SHARE and unit.any() and (columns < 0).any())


def _are_colors(columns: FloatArray) -> bool:
    if not np.isfinite(columns).all() or (columns < 0).any():
        return False
    highest = columns.max(initial=0.0)
    return bool(highest <= 1.0 or (highest <= 65535 and (columns == np.rint(columns)).all()))


def _counts_rows(column: FloatArray) -> bool:
    steps = np.diff(column)
    return len(column) > 2 and column[0] in (0.0, 1.0) and bool((steps == 1.0).all())


def _roles(names: Sequence[str]) -> dict[str, int]:
    """Return the column of each role; the plainest name counts where several fit."""
    plain = [_plain(name) for name in names]
    roles: dict[str, int] = {}
    for index, name in enumerate(plain):
        if name in AXES:
            roles.setdefault(name, index)
    if not all(axis in roles for axis in AXES):
        for index, name in enumerate(plain):
            if (match := _AXIS.fullmatch(name)) is not None:
                roles.setdefault(match[1], index)
            elif (match := _NUMBERED_AXIS.fullmatch(name)) is not None:
                roles.setdefault(_DIGITS[match[1]], index)
        for axis, known in zip(AXES, (*_PROJECTED, _HEIGHT), strict=True):
            for index, name in enumerate(plain):
                if name in known:
                    roles.setdefault(axis, index)
    for index, name in enumerate(plain):
        if index in roles.values():
            continue
        if (match := _NORMAL.fullmatch(name)) is not None:
            axis = match[1] or match[2]
            roles.setdefault(f"n{_DIGITS.get(axis, axis)}", index)
        elif (match := _COLOR.fullmatch(name)) is not None:
            roles.setdefault(next(color for color in COLORS if color.startswith(match[1][0])), index)
    return roles


def _plain(name: str) -> str:
    """Return a name in lower case, without units in brackets and without signs."""
    return re.sub(r"[\W_]", "", re.sub(r"[\[(].*?[\])]", "", name.lower()))
