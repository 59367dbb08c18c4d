"""Assign programs to splits: by a published list, or by structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.errors import ShardFailed
from stages.shape.collection.assignment import SPLITS, assign_splits
from stages.shapeassembly.settings import ProgramFiles, ShapeAssemblyConfig
from stages.shapeassembly.sources import names_of_list


def splits_of(
    rows: Sequence[Mapping[str, Any]], config: ShapeAssemblyConfig, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """Return the split of each row, int64 (n,), an index into SPLITS.

    Programs of a source with `lists` follow these. Other programs of one structure share a split.
    rows: with `kit`, the name of the source, `file`, the name in it, and `graph`, the structure.
    Raises ShardFailed for a missing list, a list that names a program twice, or lists that name no accepted program.
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
        files = {PurePosixPath(row["file"]).stem for row in rows if row["kit"] == kit}
        if files and names and not files & set(names):
            raise ShardFailed(f"shapeassembly.programs[{kit}].lists name none of its programs, such as {min(files)}")
    return split_of


def _listed(source: ProgramFiles) -> dict[str, int]:
    """Return the split of every listed program of a source, by name without folder and suffix."""
    key = f"shapeassembly.programs[{source.name}].lists"
    splits: dict[str, int] = {}
    for split, name in source.lists.items():
        try:
            names = names_of_list(source.path, name)
        except KeyError:
            raise ShardFailed(f"{key}: there is no {name} in {source.path}") from None
        for program in names:
            stem = program.removesuffix(".txt")
            if splits.setdefault(stem, SPLITS.index(split)) != SPLITS.index(split):
                raise ShardFailed(f"{key} name {program} for both val and test")
    return splits
