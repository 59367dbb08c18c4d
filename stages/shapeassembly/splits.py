"""Which split each program stands in: the one that a published list names, or one shared out by structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.errors import ShardFailed
from stages.shape.collection.assignment import SPLITS, assign_splits
from stages.shapeassembly.settings import ProgramFiles, ShapeAssemblyConfig
from stages.shapeassembly.sources import listed_names


def splits_of(
    rows: Sequence[Mapping[str, Any]], config: ShapeAssemblyConfig, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """The split of each row, int64 (n,), counted as in SPLITS.

    Programs of a source with `lists` stand where these say. Of the others, those of one structure stand in one split.
    rows: each with `kit`, the name of its source, `file`, its own name there, and `graph`, its structure. Raises
    ShardFailed for a list that is not there, and for one that names a program twice or one that no accepted row is.
    """
    listed = {source.name: _listed(source) for source in config.programs if source.lists}
    split_of = np.zeros(len(rows), dtype=np.int64)
    free: list[int] = []
    groups: dict[str, list[int]] = {}
    for index, row in enumerate(rows):
        if row["kit"] in listed:
            split_of[index] = listed[row["kit"]].get(PurePosixPath(row["file"]).stem, 0)
        else:
            groups.setdefault(row["graph"], []).append(len(free))
            free.append(index)
    split_of[free] = assign_splits(list(groups.values()), config.splits, rng)
    for kit, names in listed.items():
        there = {PurePosixPath(row["file"]).stem for row in rows if row["kit"] == kit}
        if there and names and not there & set(names):
            raise ShardFailed(f"shapeassembly.programs[{kit}].lists name none of its programs, such as {min(there)}")
    return split_of


def _listed(source: ProgramFiles) -> dict[str, int]:
    """The split of every program that a list of the source names, by its name without folder and ending."""
    key = f"shapeassembly.programs[{source.name}].lists"
    found: dict[str, int] = {}
    for split, name in source.lists.items():
        try:
            names = listed_names(source.path, name)
        except KeyError:
            raise ShardFailed(f"{key}: there is no {name} in {source.path}") from None
        for each in names:
            stem = each.removesuffix(".txt")
            if found.setdefault(stem, SPLITS.index(split)) != SPLITS.index(split):
                raise ShardFailed(f"{key} name {each} for both val and test")
    return found
