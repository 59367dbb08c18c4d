"""Changes of a layout: periods of a row along a line, bays between mirrored ends, bays of modules, another number of
sectors about an axis, another number of parts in graded rows or of scattered parts, or divided fronts; and their JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.rows.divisions import MAX_PIECES, Division, divided
from stages.rows.graded_rows import Respacing, respaced
from stages.rows.layout import Layout
from stages.rows.mirrored_bays import with_mirrored_bays
from stages.rows.modular_bays import with_modular_bays
from stages.rows.scattered import FULL_TURN_DEGREES, Scattering, TurnedCopy, rescattered
from stages.rows.slabs import RowChange, repeat
from stages.rows.turns import Turn, turned

Change = RowChange | Turn | Division | Respacing | Scattering

AXES = ("x", "y", "z")
MAX_TIMES = 1000
"""Most periods, sectors or parts that one change may make."""


def changed(layout: Layout, change: Change) -> Layout:
    """Return a changed layout. Raises SlabError for a change that is not valid."""
    if isinstance(change, Turn):
        return turned(layout, change)
    if isinstance(change, Division):
        return divided(layout, change)
    if isinstance(change, Respacing):
        return respaced(layout, change)
    if isinstance(change, Scattering):
        return rescattered(layout, change)
    if change.is_modular:
        return with_modular_bays(layout, change)
    return with_mirrored_bays(layout, change) if change.is_mirrored else repeat(layout, change)


def change_json(change: Change) -> dict[str, Any]:
    """Return a change as JSON."""
    if isinstance(change, Turn):
        centre, numbers = change.centre.tolist(), {"sectors": change.sectors, "count": change.count}
        return {"axis": AXES[change.axis], "centre": centre, **numbers}
    if isinstance(change, Division):
        return {"fronts": list(change.fronts), "axis": AXES[change.axis], "pieces": change.count}
    if isinstance(change, Respacing):
        return {"graded_rows": [list(parts) for parts in change.rows], "count": change.count}
    if isinstance(change, Scattering):
        changes = {"removed": list(change.removed), "copies": [list(copy) for copy in change.copies]}
        return {"scattered": list(change.parts), "axis": AXES[change.up], **changes}
    return {
        "normal": change.normal.tolist(),
        "shift": change.shift.tolist(),
        "at": change.at,
        "times": change.times,
        **({"is_bay": True} if change.is_bay else {}),
        **({"is_mirrored": True} if change.is_mirrored else {}),
        **({"is_modular": True} if change.is_modular else {}),
    }


def changes_text(changes: Sequence[Change]) -> str:
    """Return changes as the text of a JSON array."""
    return json.dumps([change_json(change) for change in changes])


def read_changes(text: str) -> list[Change]:
    """Return changes from their text. Raises ValueError, TypeError or KeyError."""
    return [read_change(stated) for stated in json.loads(text)]


def read_change(stated: Mapping[str, Any]) -> Change:
    """Return a change from its JSON. Raises ValueError, TypeError or KeyError."""
    if "fronts" in stated:
        fronts, pieces = tuple(int(part) for part in stated["fronts"]), int(stated["pieces"])
        if stated["axis"] not in AXES or not fronts or min(fronts) < 0 or not 2 <= pieces <= MAX_PIECES:
            raise ValueError(f"fronts are divided along x, y or z into 2 to {MAX_PIECES} pieces, unlike {stated}")
        return Division(fronts, AXES.index(stated["axis"]), pieces)
    if "graded_rows" in stated:
        rows = tuple(tuple(int(part) for part in parts) for parts in stated["graded_rows"])
        count = int(stated["count"])
        if not rows or min(min(parts, default=-1) for parts in rows) < 0 or not 0 < count <= MAX_TIMES:
            raise ValueError(f"a graded row has numbers of parts, and gets 1 to {MAX_TIMES} parts, unlike {stated}")
        return Respacing(rows, count)
    if "scattered" in stated:
        return _read_scattering(stated)
    if "axis" in stated:
        centre = np.array(stated["centre"], dtype=np.float64).reshape(3)
        sectors, count = int(stated["sectors"]), int(stated["count"])
        if stated["axis"] not in AXES or not np.isfinite(centre).all() or not 0 < count <= MAX_TIMES:
            raise ValueError(f"a row about an axis (x, y or z) has 1 to {MAX_TIMES} sectors, unlike {stated}")
        return Turn(AXES.index(stated["axis"]), centre, sectors, count)
    normal, shift = (np.array(stated[key], dtype=np.float64).reshape(3) for key in ("normal", "shift"))
    at, times = float(stated["at"]), int(stated["times"])
    numbers = [*normal.tolist(), *shift.tolist(), at]
    if not np.isfinite(numbers).all() or normal @ shift <= 0 or not (times == -1 or 0 < times <= MAX_TIMES):
        raise ValueError(
            f"a row changes by -1 or by 1 to {MAX_TIMES} periods, and its step follows its normal, unlike {stated}"
        )
    kinds = {key: bool(stated.get(key, False)) for key in ("is_bay", "is_mirrored", "is_modular")}
    return RowChange(normal, shift, at, times, **kinds)


def _read_scattering(stated: Mapping[str, Any]) -> Scattering:
    """Return another number of scattered parts from its JSON. Raises ValueError, TypeError or KeyError."""
    parts, removed = (tuple(int(part) for part in stated[key]) for key in ("scattered", "removed"))
    copies = tuple(TurnedCopy(int(part), int(degrees)) for part, degrees in stated["copies"])
    are_turns = all(0 < copy.degrees < FULL_TURN_DEGREES for copy in copies)
    if stated["axis"] not in AXES or min(parts, default=-1) < 0 or not are_turns or len(copies) > MAX_TIMES:
        raise ValueError(
            f"scattered parts have numbers, and up to {MAX_TIMES} copies, turned about x, y or z by 1 to "
            f"{FULL_TURN_DEGREES - 1} degrees, unlike {stated}"
        )
    return Scattering(parts, AXES.index(stated["axis"]), removed, copies)
