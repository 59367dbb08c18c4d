"""Who comes from whom in a pool: parents, children and siblings of one cut, and the ancestors that a sample names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.stage import Task
from stages.variations.search.pool import FoundVariants, PoolIndex

Ancestor = int | str
"""A variant by its place in the pool, or an exemplar by its name."""


@dataclass(frozen=True)
class Ancestry:
    """parents: of each variant of the pool the nearest ancestors that are in the pool too, or exemplars: those that it
    was made of, or theirs where the pool did not keep one. cuts: what tells the cut that it was made by, the same
    for pieces cut alike out of one variant and docked to one other; empty for cuts of exemplars docked to exemplars."""

    parents: Sequence[tuple[Ancestor, ...]]
    cuts: Sequence[str]

    def kin(self) -> list[np.ndarray]:
        """For each variant its parents, children and siblings of one cut in the pool, int64 (k,), ascending."""
        kin: list[set[int]] = [set() for _ in self.parents]
        for child, parents in enumerate(self.parents):
            for parent in parents:
                if isinstance(parent, int):
                    kin[child].add(parent)
                    kin[parent].add(child)
        siblings: dict[str, list[int]] = {}
        for variant, cut in enumerate(self.cuts):
            if cut:
                siblings.setdefault(cut, []).append(variant)
        for group in siblings.values():
            for variant in group:
                kin[variant].update(group)
        return [np.array(sorted(each - {variant}), dtype=np.int64) for variant, each in enumerate(kin)]

    def named(self, key_of: Mapping[int, str], split_of: Mapping[int, int]) -> dict[int, list[str]]:
        """For each variant that becomes a sample, with its key and split, the names of its nearest ancestors among the
        samples of its own split and the exemplars. What was left out, or stands in another split, is passed over for
        what it came from."""
        found: dict[int, list[str]] = {}
        known: dict[int, list[tuple[str, ...]]] = {split: [] for split in set(split_of.values())}
        for variant, parents in enumerate(self.parents):
            for split, names_of in known.items():
                names: dict[str, None] = {}
                for parent in parents:
                    names.update(dict.fromkeys([parent] if isinstance(parent, str) else names_of[parent]))
                own = split_of.get(variant) == split
                if own:
                    found[variant] = list(names)
                names_of.append((key_of[variant],) if own else tuple(names))
        return found


def read_ancestry(task: Task, pool: PoolIndex) -> Ancestry:
    """The ancestry of a kit's pool, from the lineages of everything that its lanes found. A parent stands before its
    children: in an earlier round, or earlier in the same lane."""
    places = {(lane, index): place for place, (lane, index) in enumerate(pool.rows.tolist())}
    ancestors: dict[str, tuple[Ancestor, ...]] = {}
    parents: list[tuple[Ancestor, ...]] = [()] * len(pool)
    cuts = [""] * len(pool)
    for lane, name in enumerate(pool.lanes):
        found = FoundVariants.of(task, name)
        for index in range(len(found)):
            lineage = found.described(index)
            made_of = lineage["parents"]
            joined = [each for parent in made_of for each in ancestors.get(parent, (parent,))]
            nearest = tuple(dict.fromkeys(joined))
            place = places.get((lane, index))
            if place is None:
                ancestors[f"{name}-{index}"] = nearest
                continue
            ancestors[f"{name}-{index}"] = (place,)
            parents[place] = nearest
            if any(parent in ancestors for parent in made_of):
                cuts[place] = f"{made_of} {lineage['boundary']}"
    return Ancestry(parents, cuts)
