"""Ancestry in a pool: parents, children and siblings of one cut, and the ancestors that a sample names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.stage import Task
from stages.variations.search.pool import FoundVariants, PoolIndex

Ancestor = int | str
"""A variant by its number in the pool, or an exemplar by its name."""


@dataclass(frozen=True)
class Ancestry:
    """The ancestors of the variants of a pool."""

    parents: Sequence[tuple[Ancestor, ...]]  # for each variant the nearest ancestors in the pool or among the exemplars
    cuts: Sequence[str]
    """For each variant its cut: the same for pieces cut alike from one variant and docked to the same other one, empty
    for cuts of exemplars docked to exemplars."""

    def kin(self) -> list[np.ndarray]:
        """Return for each variant its parents, children and siblings of one cut in the pool, int64 (k,), ascending."""
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
        return [np.array(sorted(relatives - {variant}), dtype=np.int64) for variant, relatives in enumerate(kin)]

    def named(self, key_of: Mapping[int, str], split_of: Mapping[int, int]) -> dict[int, list[str]]:
        """Return for each variant that becomes a sample the names of its nearest ancestors.

        These are samples of its own split and exemplars. Variants that are left out or in another split are replaced by
        their own ancestors.
        key_of: key of each sample by variant; split_of: its split
        """
        named_parents: dict[int, list[str]] = {}
        known: dict[int, list[tuple[str, ...]]] = {split: [] for split in set(split_of.values())}
        for variant, parents in enumerate(self.parents):
            for split, names_of in known.items():
                names: dict[str, None] = {}
                for parent in parents:
                    names.update(dict.fromkeys([parent] if isinstance(parent, str) else names_of[parent]))
                own = split_of.get(variant) == split
                if own:
                    named_parents[variant] = list(names)
                names_of.append((key_of[variant],) if own else tuple(names))
        return named_parents


def read_ancestry(task: Task, pool: PoolIndex) -> Ancestry:
    """Return the ancestry of a kit's pool, read from the lineages of all that its searches found.

    Parents come before their children: in an earlier round, or earlier in the same search.
    """
    numbers = {(search, index): number for number, (search, index) in enumerate(pool.rows.tolist())}
    ancestors: dict[str, tuple[Ancestor, ...]] = {}
    parents: list[tuple[Ancestor, ...]] = [()] * len(pool)
    cuts = [""] * len(pool)
    for search, name in enumerate(pool.searches):
        found = FoundVariants.of(task, name)
        indices = {number: index for index, number in enumerate(found.numbers.tolist())}
        for own_number, lineage in enumerate(found.lineages()):
            made_of = lineage["parents"]
            joined = [ancestor for parent in made_of for ancestor in ancestors.get(parent, (parent,))]
            nearest = tuple(dict.fromkeys(joined))
            number = numbers.get((search, indices.get(own_number, -1)))
            if number is None:
                ancestors[f"{name}-{own_number}"] = nearest
                continue
            ancestors[f"{name}-{own_number}"] = (number,)
            parents[number] = nearest
            if any(parent in ancestors for parent in made_of):
                cuts[number] = f"{made_of} {lineage['boundary']}"
    return Ancestry(parents, cuts)
