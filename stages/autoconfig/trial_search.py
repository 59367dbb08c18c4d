"""A trial search: a short search whose result predicts the number and the diversity of what a long one finds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from stages.autoconfig.moved_surface import MovedSurface
from stages.rows.settings import RowsConfig
from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.histograms import histogram_metric
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly, Kit
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE
from stages.variations.requirements.hub_restoration import HUBS_NOT_RESTORED, HubRestorer
from stages.variations.requirements.identity import share_bounds
from stages.variations.requirements.required_labels import LABELS_MISSING, labels_test, spanning_labels
from stages.variations.search.row_variants import RowVariants
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.selection.farthest_first import farthest_first
from stages.variations.settings import SearchConfig

MAX_MOST_DIFFERENT = 24
"""Hits, the most different ones, that measure diversity."""

MIN_NON_COPY_RATE = 0.25
"""Share of hits that are no near copies, from which a search that rejects near copies still finishes."""
MIN_EXEMPLAR_DISTANCE, MIN_PAIR_DISTANCE = 0.05, 0.03
"""Distances E to the nearest exemplar and between two hits, below which a pool has low diversity."""
MIN_MOVED_DISTANCE = 0.02
"""Distance of surfaces, as a share of the exemplar's diagonal, below which hits look like the exemplar."""
TRIAL_METHODS: tuple[Literal["exchange", "growth"], ...] = ("exchange", "growth")
"""Each method has its own tries: one grown shape of a large kit costs as much as hundreds of exchanges."""
MAX_GROWTH_DEGREE = 40
"""Growth is skipped if a part has more neighbours: all around it would be a copy, and slow."""
GROWTH_FIRST_DIVISOR = 5
"""Growth stops if it finds nothing in this fraction of its tries."""
HOPELESS_GROWTH_DIVISOR = 4
"""The fraction is smaller by this factor if the exchange found nothing and the grammar has no slots."""
MIN_KEEPING_HITS = 10
"""With fewer hits that are no near copies a search keeps fewer labels."""
MAX_RELAXATIONS = 2
RELAXED_SHARE = 0.9
"""Labels missing at least this share as often as the one missing most are given up together."""
TRIAL_CONFIG = SearchConfig(duplicates="graph")
"""Distinct graphs are counted, whatever the config calls a duplicate. By meaning, parts lists are counted, since graphs
do not tell a turned leg from a square one."""


@dataclass(frozen=True)
class TrialResult:
    """What a trial search found; its hits are the distinct variants that it accepts.

    tries: number of tries.
    graphs: number of distinct graphs; by meaning, of graphs with distinct histograms.
    histograms: number of distinct histograms of part types.
    distance: mean histogram metric E (strings §5.3) from the most different hits to their nearest exemplar.
    pair_distance: median of E between two of the most different hits.
    copied_share: median share of a hit in its largest verbatim piece of an exemplar.
    non_copy_rate: share of the hits that are no near copies.
    seen_fillings_share: share of the parts of the most different hits whose slot fillings occur in an exemplar; 1
        without slots.
    lost_labels: labels that the hits need not keep, since a search that kept them found next to nothing.
    by_meaning: whether exchanging one part for another of its meaning counts as a hit.
    most_different: indices into the variants, most different first.
    rejects: rejected tries by reason.
    moved: median over the most different hits of the distance that `MovedSurface` measures.
    """

    tries: int
    graphs: int
    histograms: int
    distance: float
    pair_distance: float
    copied_share: float = 1.0
    non_copy_rate: float = 0.0
    seen_fillings_share: float = 1.0
    lost_labels: tuple[str, ...] = ()
    by_meaning: bool = False
    most_different: tuple[int, ...] = ()
    rejects: Mapping[str, int] = field(default_factory=dict)
    moved: float = 1.0

    def as_json(self) -> dict[str, Any]:
        """Return what predicts a long search, for records and programs."""
        keys = ("tries", "graphs", "histograms", "distance", "pair_distance", "copied_share", "non_copy_rate")
        return {key: getattr(self, key) for key in keys}

    @property
    def looks_like_exemplar(self) -> bool:
        """Whether there are hits, and their surfaces are next to nowhere away from an exemplar's."""
        return bool(self.graphs) and self.moved < MIN_MOVED_DISTANCE and not self.by_meaning

    @property
    def text(self) -> str:
        """What was found, in words, without the diversity."""
        if not self.graphs:
            return f"nothing in {self.tries:,} tries"
        return f"{self.graphs:,} graphs and {self.histograms:,} histograms in {self.tries:,} tries"


def has_low_diversity(trial: TrialResult) -> bool:
    """Return whether hits look like an exemplar or like each other.

    Near copies do no harm by meaning, nor if there are enough other hits, because they are rejected then.
    """
    copies = trial.copied_share >= NEAR_COPY_SHARE and trial.non_copy_rate < MIN_NON_COPY_RATE and not trial.by_meaning
    is_alike = trial.distance < MIN_EXEMPLAR_DISTANCE or trial.pair_distance < MIN_PAIR_DISTANCE
    return is_alike or copies or trial.looks_like_exemplar


class TrialSearch:
    """A search of one kit that can be continued; its result depends on the kit and the random stream only.

    Hits have the kit's required labels, get back the hubs that are required and respect the limit on copies.
    """

    def __init__(
        self,
        oracle: ContactOracle,
        rng: np.random.Generator,
        min_hubs: float = 0,
        max_copied_share: float = 1.0,
        copies: CopyDetector | None = None,
        keep_types: Sequence[str] = (),
    ) -> None:
        """Prepare a search of the kit of `oracle`.

        min_hubs: hubs that a hit must get back, as for `HubRestorer.has_hubs`.
        max_copied_share: largest share of a hit that may be one verbatim piece of an exemplar.
        copies: as for Search.
        keep_types: labels that hits keep, without those of them that cannot be kept.
        """
        self.kit = oracle.kit
        self.variants: list[Variant] = []
        self._moved = MovedSurface(self.kit)
        self._rng = rng
        self._known_keys: set[int] = set()
        self._max_copied_share, self._min_hubs = max_copied_share, min_hubs
        self._rejects = Counter[str]()
        self._has_labels = labels_test(self.kit, spanning_labels(self.kit))
        self._hubs = HubRestorer(oracle, upright=True)
        self._tries = 0
        exemplars = [exemplar.assembly for exemplar in self.kit.exemplars]
        degree = max(int(np.bincount(assembly.edges.ravel(), minlength=1).max()) for assembly in exemplars)
        methods = TRIAL_METHODS if degree <= MAX_GROWTH_DEGREE else TRIAL_METHODS[:1]
        has_slots = self.kit.grammar.strictness in SLOT_LEVELS
        self._slots = SlotGrammar(self.kit, oracle.dockings, TRIAL_CONFIG.upright) if has_slots else None
        duplicates = {"duplicates": "histogram"} if self.kit.by_meaning else {}
        copies = copies or CopyDetector(self.kit, oracle.dockings)
        self._kept, self._all_kept = list(keep_types), tuple(keep_types)
        self._shares = share_bounds(self.kit, self._kept)
        self._searches = [
            Search(
                oracle,
                TRIAL_CONFIG.model_copy(update={"method": method, **duplicates}),
                self._slots,
                copies,
                self._shares,
            )
            for method in methods
        ]

    def run(self, tries: int, wanted: int, evenly: bool = False) -> TrialResult:
        """Search on by each method until there are `wanted` variants, or `tries` more tries were spent.

        evenly: no method finds more than its share while another still can. Growth completes every shape, so it stops
        as soon as its first shapes show nothing new. If next to nothing is found, or hits that look alike, labels that
        were missing most are no longer kept, unless that does not help either. The first run decides.
        """
        relaxations = 0 if self._tries else MAX_RELAXATIONS
        self._search(tries, wanted, evenly)
        for _ in range(relaxations):
            if self._is_useful() or not self._relax():
                break
            self._search(tries, max(wanted, len(self.variants) + MIN_KEEPING_HITS), evenly)
        if len(self._kept) < len(self._all_kept) and not self._is_useful():
            self._keep(self._all_kept)
            self.variants = [hit for hit in self.variants if self._searches[0].keeps_shares(hit.assembly)]
        return self.result()

    def _is_useful(self) -> bool:
        """Return whether there are some hits that are no near copies, and not all are alike."""
        if len(self.variants) < MIN_KEEPING_HITS:
            return False
        if self.kit.by_meaning:
            return True
        novel = sum(_copied_share(variant) <= NEAR_COPY_SHARE for variant in self.variants)
        return novel >= MIN_KEEPING_HITS and not has_low_diversity(self.result())

    def _relax(self) -> bool:
        """Give up the label that was out of proportion most often, and of those that were nearly as often."""
        missed = np.sum([search.out_of_proportion for search in self._searches], axis=0)
        if not missed.any():
            return False
        lost = {self.kit.labels[index] for index in np.flatnonzero(missed >= RELAXED_SHARE * missed.max()).tolist()}
        self._keep([label for label in self._kept if label not in lost])
        for search in self._searches:
            search.out_of_proportion[:] = 0
        return True

    def _keep(self, labels: Sequence[str]) -> None:
        """Keep these labels from now on; all searches read the same bounds."""
        self._kept = list(labels)
        self._shares[:] = share_bounds(self.kit, self._kept)

    def _search(self, tries: int, wanted: int, evenly: bool) -> None:
        left = [tries] * len(self._searches)
        if evenly:
            for number in range(len(self._searches)):
                self._run_method(number, wanted * (number + 1) // len(self._searches), tries, left)
        for number in range(len(self._searches)):
            self._run_method(number, wanted, tries, left)

    def _run_method(self, number: int, wanted: int, tries: int, left: list[int]) -> None:
        """Search on by one method, with what is left of its `tries`; nothing is left once a search finds nothing."""
        search = self._searches[number]
        while left[number] > 0 and len(self.variants) < wanted:
            is_first_growth = search.config.method == "growth" and left[number] == tries
            is_hopeless = not self.variants and self._slots is None and len(self._searches) > 1
            divisor = GROWTH_FIRST_DIVISOR * (HOPELESS_GROWTH_DIVISOR if is_hopeless else 1)
            budget = max(tries // divisor, 1) if is_first_growth else left[number]
            missing = wanted - len(self.variants)
            variants, used = search.run(self._rng, budget, missing, f"trial-{self._tries}", lambda _: None)
            self._tries += used
            left[number] = left[number] - used if used and variants else 0
            self.variants.extend(self._new_hits(variants))

    def _new_hits(self, variants: Sequence[Variant]) -> list[Variant]:
        """Return the variants that are accepted and that no method found before; count what the others lack."""
        search = self._searches[0]
        kept = [variant for variant in variants if search.keeps_shares(variant.assembly)]
        complete = [variant for variant in kept if self._is_complete(variant.assembly)]
        hits = [variant for variant in complete if _copied_share(variant) <= self._max_copied_share]
        keys = [search.maker.key(variant.assembly.types, variant.graph, variant.graph) for variant in hits]
        new = [hit for hit, key in zip(hits, keys, strict=True) if key not in self._known_keys]
        self._known_keys.update(keys)
        return new

    def other_rows(self, rng: np.random.Generator, wanted: int) -> list[Variant]:
        """Return at most `wanted` exemplars with longer or shorter rows that a run accepts and that were not found yet.

        The result of the search does not count them.
        """
        rows = RowVariants(self.kit, RowsConfig())
        return self._new_hits(self._searches[0].with_rows(rng, rows, wanted, "rows"))

    def _is_complete(self, assembly: Assembly) -> bool:
        """Return whether a variant has its required labels and hubs; count what it lacks."""
        if not self._has_labels(assembly):
            self._rejects[LABELS_MISSING] += 1
            return False
        if self._min_hubs and not self._hubs.has_hubs(self._min_hubs, self._hubs.fit(assembly)):
            self._rejects[HUBS_NOT_RESTORED] += 1
            return False
        return True

    def with_hubs(self, index: int) -> Assembly:
        """Return the variant at an index with its hubs restored."""
        return self._hubs.fit(self.variants[index].assembly)

    def result(self) -> TrialResult:
        """Return what was found so far."""
        rejects = dict(sum((search.rejects for search in self._searches), self._rejects).most_common())
        counts = type_counts(self.kit, [variant.assembly.types for variant in self.variants])
        exemplars = type_counts(self.kit, [exemplar.assembly.types for exemplar in self.kit.exemplars])
        if not self.variants:
            return TrialResult(self._tries, 0, 0, 0.0, 0.0, rejects=rejects)
        copied = np.array([_copied_share(variant) for variant in self.variants])
        most_different = farthest_first(counts, exemplars, min(MAX_MOST_DIFFERENT, len(counts)))
        chosen = counts[most_different]
        nearest = histogram_metric(chosen[:, None], exemplars[None]).min(axis=1)
        pairs = histogram_metric(chosen[:, None], chosen[None])[np.triu_indices(len(chosen), 1)]
        return TrialResult(
            tries=self._tries,
            graphs=len(self.variants),
            histograms=len(np.unique(counts, axis=0)),
            distance=round(float(nearest.mean()), 4),
            pair_distance=round(float(np.median(pairs)), 4) if len(pairs) else 0.0,
            copied_share=round(float(np.median(copied)), 4),
            non_copy_rate=round(float(np.mean(copied <= NEAR_COPY_SHARE)), 4),
            seen_fillings_share=self._seen_fillings_share(most_different.tolist()),
            lost_labels=tuple(label for label in self._all_kept if label not in self._kept),
            by_meaning=self.kit.by_meaning,
            most_different=tuple(most_different.tolist()),
            rejects=rejects,
            moved=self._moved.distance([self.variants[index].assembly for index in most_different.tolist()]),
        )

    def _seen_fillings_share(self, indices: Sequence[int]) -> float:
        if self._slots is None:
            return 1.0
        return round(
            float(np.mean([self._slots.observed_share(self.variants[index].assembly) for index in indices])), 4
        )


def _copied_share(variant: Variant) -> float:
    share: float = variant.lineage["copied"]["share"]
    return share


def type_counts(kit: Kit, shapes: Sequence[np.ndarray]) -> FloatArray:
    """Return the number of parts of each type, float64 (k, types), of `shapes`, each the types of its parts."""
    counts = [np.bincount(types, minlength=len(kit.types)) for types in shapes]
    return np.array(counts, dtype=np.float64).reshape(-1, len(kit.types))
