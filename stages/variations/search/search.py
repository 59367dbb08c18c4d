"""The search for variants of a kit: plan tries, make variants, and learn from what they bring (strings §4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly
from stages.variations.kernels.operators import GROWTH, REPLACEMENT
from stages.variations.kernels.tables import shape_tables
from stages.variations.novelty.archive import Archive, Place
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.novelty.features import material_shares
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE
from stages.variations.requirements.identity import out_of_bounds
from stages.variations.search.operator_selection import TRIES_PER_PLAN, TRY_WORK, OperatorSelector, PlannedTry
from stages.variations.search.parents import Parent, Parents
from stages.variations.search.row_variants import RowVariants
from stages.variations.search.variant import EARLY_REASONS, NEW_VARIANT, OUT_OF_PROPORTION, Variant
from stages.variations.search.variant_maker import VariantMaker
from stages.variations.settings import SearchConfig

RESERVE_FACTOR = 4
"""A search ends at this many times the variants that it looks for, even if few of them add to the archive."""
KNOWN_HISTOGRAM_GAIN = 0.2
"""Gain of a new variant with a known histogram; one with a new histogram has gain 1."""
MAX_ROW_DRAWS_IN_VAIN = 24
"""Draws of rows without a new variant after which no more are made."""
MIN_BATCHES_IN_VAIN = 16
STEPPING_STONE_GAIN = 0.1
"""Gain of a new variant that does not keep the shares."""
JOINED_TRY_WORK = 3.0
"""Work of an exchange that comes as far as joining pieces; one that finds no match has work 1."""


class Search:
    """A search worker: its parents, its archive, and what it has learnt about operators.

    slots, copies, shares: as for `VariantMaker`
    out_of_proportion: for each label the drafts in which it was missing or too frequent, int64 (labels,)
    """

    def __init__(
        self,
        oracle: ContactOracle,
        config: SearchConfig,
        slots: SlotGrammar | None = None,
        copies: CopyDetector | None = None,
        shares: FloatArray | None = None,
    ) -> None:
        self.kit, self.oracle, self.config = oracle.kit, oracle, config
        self.maker = VariantMaker(oracle, config, slots, copies, shares)
        self.archive = Archive(config.novelty.cell_quota)
        self.operators = OperatorSelector(config, self.kit.by_meaning)
        exemplars = [self._exemplar(number) for number in range(len(self.kit.exemplars))]
        self.parents = Parents(exemplars, config.max_parents)
        self.maker.remember_exemplars(self.parents.exemplars)
        self.reserve = 0
        self._batches_in_vain = 0
        self.rejects: Counter[str] = Counter()
        self.out_of_proportion = np.zeros(len(self.kit.labels), dtype=np.int64)
        self.crossings: Counter[str] = Counter()

    def _exemplar(self, number: int) -> Parent:
        exemplar = self.kit.exemplars[number]
        origins = np.full(len(exemplar.assembly), number, dtype=np.int8)
        cell = self.maker.cell(self.maker.exemplar_features(number))
        place = self.archive.add(cell, self.maker.histogram(exemplar.assembly.types))
        return self.parent(exemplar.name, exemplar.assembly, origins, place)

    def parent(
        self, name: str, assembly: Assembly, origins: np.ndarray, place: Place, labels: IntArray | None = None
    ) -> Parent:
        """Return a shape made ready for cutting and docking. place: its place in the archive."""
        if labels is None:
            labels = self.oracle.dockings.label_edges(assembly.types, assembly.poses, assembly.edges)
        shares = material_shares(origins, len(self.kit.exemplars))
        tables = shape_tables(assembly, labels, len(self.kit.types))
        return Parent(name, assembly, labels, tables, origins, shares, place)

    def adopt(self, rng: np.random.Generator, parent: Parent) -> None:
        """Add a parent."""
        self.parents.adopt(rng, parent, self.archive)

    def with_rows(self, rng: np.random.Generator, rows: RowVariants, wanted: int, name: str) -> list[Variant]:
        """Return at most `wanted` new variants that are exemplars with longer or shorter rows.

        They are parents of what `run` finds, and lineages call them `<name>-<number>`.
        """
        found: list[Variant] = []
        in_vain = 0
        while rows and len(found) < wanted and in_vain < MAX_ROW_DRAWS_IN_VAIN:
            in_vain += 1
            changed = rows.draw(rng)
            result = changed if isinstance(changed, str) else self.maker.with_rows(changed)
            if isinstance(result, str):
                self.rejects[result] += 1
                continue
            in_vain = 0
            found.append(replace(result, number=len(found)))
            self._keep(rng, found[-1], f"{name}-{found[-1].number}", keeps=True)
        return found

    def run(
        self,
        rng: np.random.Generator,
        tries: int,
        wanted: int,
        name: str,
        progress: Callable[[int], None],
        known: Sequence[Variant] = (),
    ) -> tuple[list[Variant], int]:
        """Search for `wanted` new variants that add to the archive; return all new variants and the number of tries.

        The search also ends after `tries`, or after RESERVE_FACTOR times `wanted` variants of any kind. Variants that
        add to the archive become parents at once; lineages call them `<name>-<number>`.

        Variants that do not keep the `shares` are returned too (see `keeps_shares`), but do not count as found. They
        are stepping stones: parents of others that may keep them. They are refused early, except in every second batch
        of tries after MIN_BATCHES_IN_VAIN batches that found nothing but near copies.
        progress: is told how many there are
        known: what `with_rows` found, which is returned first
        """
        found = list(known)
        novel, kept, number = 0, 0, 0
        while number < tries and novel < wanted and kept < RESERVE_FACTOR * wanted:
            batch = self.operators.plan(rng, self.parents, self.archive, min(TRIES_PER_PLAN, tries - number))
            may_step = self._batches_in_vain >= MIN_BATCHES_IN_VAIN and self._batches_in_vain % 2 == 0
            self.maker.enforce_shares(not may_step)
            self._batches_in_vain += 1
            for planned in batch:
                if number >= tries:  # a grown shape costs many tries
                    break
                result, work, planned = self._try(rng, planned)
                exchanged = planned.operator not in (GROWTH, REPLACEMENT)
                number += 1 if exchanged else max(round(work / TRY_WORK), 1)
                if isinstance(result, str):
                    self.rejects[result] += 1
                    if result == OUT_OF_PROPORTION:
                        self._count_out_of_proportion(self.maker.draft_label_counts())
                    self.operators.learn(planned, 0.0, work)
                    continue
                result = replace(result, number=len(found))
                found.append(result)
                keeps = self.keeps_shares(result.assembly)
                if not keeps:
                    self._count_out_of_proportion(self.maker.draft_label_counts())
                kept += keeps
                if keeps and result.lineage["copied"]["share"] <= NEAR_COPY_SHARE:
                    self._batches_in_vain = 0
                gain = self._keep(rng, result, f"{name}-{result.number}", keeps)
                self.operators.learn(planned, gain, work)
                if gain and keeps:
                    novel += 1
                    progress(novel)
                if novel >= wanted or kept >= RESERVE_FACTOR * wanted:
                    break
        return found, number

    def keeps_shares(self, assembly: Assembly) -> bool:
        """Return whether every label has its share of the parts of a variant."""
        shares = self.maker.shares
        if shares is None:
            return True
        counts = np.bincount(self.kit.label_of[assembly.types], minlength=len(shares))
        return not out_of_bounds(shares, counts[None]).any()

    def _count_out_of_proportion(self, counts: np.ndarray) -> None:
        if self.maker.shares is not None:
            self.out_of_proportion += out_of_bounds(self.maker.shares, counts[None])[0]

    def _try(self, rng: np.random.Generator, planned: PlannedTry) -> tuple[Variant | str, float, PlannedTry]:
        """Return a new variant or the reason for a failure, the work, and the try that it counts for."""
        if planned.operator == GROWTH:
            return (*self.maker.grow(rng), planned)
        if planned.operator == REPLACEMENT:
            return self.maker.replace(rng, planned)
        result = self.maker.exchange(rng, planned)
        if not (planned.a.shares * planned.b.shares).any():
            self.crossings[result if isinstance(result, str) else NEW_VARIANT] += 1
        return result, 1.0 if isinstance(result, str) and result in EARLY_REASONS else JOINED_TRY_WORK, planned

    def _keep(self, rng: np.random.Generator, variant: Variant, name: str, keeps: bool) -> float:
        """Count a new variant, and make it a parent where it adds to the archive; return its gain, 0 where it does not.

        keeps: whether it keeps the shares; otherwise it gains less
        """
        self.maker.remember(variant.assembly.types, variant.graph, variant.docked)
        full = self.archive.is_full(variant.cell, variant.histogram)
        gain = KNOWN_HISTOGRAM_GAIN if self.archive.has_histogram(variant.histogram) else 1.0
        place = self.archive.add(variant.cell, variant.histogram)
        if full and self.config.novelty.guided:
            self.reserve += keeps
            return 0.0
        if variant.assembly.stretches is None:  # no exemplar shows how stretched parts dock
            self.adopt(rng, self.parent(name, variant.assembly, variant.origins, place, variant.labels))
        return gain if keeps else STEPPING_STONE_GAIN
