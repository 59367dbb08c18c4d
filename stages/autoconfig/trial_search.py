"""A short search, and what it says of a long one: distinct graphs and histograms, and how far they are apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.histograms import histogram_metric
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly, Kit
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE
from stages.variations.requirements.hub_restoration import HUBS_NOT_RESTORED, HubRestorer
from stages.variations.requirements.required_labels import LABELS_MISSING, labels_test, spanning_labels
from stages.variations.search.search import Search, Variant
from stages.variations.selection.farthest_first import farthest_first
from stages.variations.settings import SearchConfig

MAX_MOST_DIFFERENT = 24
"""So many of the finds, those most different, say how different finds can be."""

TRIAL_METHODS: tuple[Literal["exchange", "growth"], ...] = ("exchange", "growth")
"""Each has tries of its own, for a grown shape of a large kit costs as much as hundreds of exchanges."""
MAX_GROWTH_DEGREE = 40
"""Where a part has more neighbours than this, nothing is grown: all around it is a copy, and dear."""
FIRST = 5
"""Growth that finds nothing in one of so many parts of its tries is given up."""
VAIN = 4
"""As many times sooner where the exchange found nothing either, by a grammar that has nothing but what was observed."""
TRIAL_CONFIG = SearchConfig(duplicates="graph")
"""A probe counts distinct graphs, whatever the config calls a duplicate. By meaning these do not tell a turned leg from
a square one, and what counts are parts lists."""


@dataclass(frozen=True)
class TrialResult:
    """What a probe found.

    tries: how many; graphs, histograms: distinct ones, by meaning only those of different histograms; distance: mean
    histogram metric E (strings §5.3) of the most different finds to their nearest exemplar; spread: median of E between
    two of them; copied: median of the largest share of a find that stands just so in an exemplar; telling: share of the
    finds that are no near copies; familiar: with a grammar of slots the share of their parts of which it was seen just
    so which slots are filled, else 1; by_meaning: whether one part in another's place is a find, though all others
    stand as they stood; most_different: their places among the variants, most different first; rejects: tries that came
    to nothing, by reason.
    """

    tries: int
    graphs: int
    histograms: int
    distance: float
    spread: float
    copied: float = 1.0
    telling: float = 0.0
    observed_share: float = 1.0
    by_meaning: bool = False
    most_different: tuple[int, ...] = ()
    rejects: Mapping[str, int] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """What it says of a long search, for records and programs."""
        return {
            "tries": self.tries,
            "graphs": self.graphs,
            "histograms": self.histograms,
            "distance": self.distance,
            "spread": self.spread,
            "copied": self.copied,
            "telling": self.telling,
        }


class TrialSearch:
    """A search of one kit that can be continued. Everything in it depends on `rng` and the kit alone. What lacks the
    kit's carcass is no find, nor is that which does not get back the `hubs` that are required, as `Backdrop.has_hubs`
    says, or of which a greater share than `copied` is copied whole. `copies`: as for Search."""

    def __init__(
        self,
        answers: ContactOracle,
        rng: np.random.Generator,
        hubs: float = 0,
        copied: float = 1.0,
        copies: CopyDetector | None = None,
    ) -> None:
        self.kit = answers.kit
        self.variants: list[Variant] = []
        self._rng = rng
        self._known: set[int] = set()
        self._copied, self._hubs = copied, hubs
        self._refused = Counter[str]()
        self._has_carcass = labels_test(self.kit, spanning_labels(self.kit))
        self._backdrop = HubRestorer(answers, upright=True)
        self._tries = 0
        widest = max(int(np.bincount(each.assembly.edges.ravel(), minlength=1).max()) for each in self.kit.exemplars)
        methods = TRIAL_METHODS if widest <= MAX_GROWTH_DEGREE else TRIAL_METHODS[:1]
        slotted = self.kit.grammar.strictness in SLOT_LEVELS
        self._slots = SlotGrammar(self.kit, answers.dockings, TRIAL_CONFIG.upright) if slotted else None
        same = {"duplicates": "histogram"} if self.kit.by_meaning else {}
        copies = copies or CopyDetector(self.kit, answers.dockings)
        self._searches = [
            Search(answers, TRIAL_CONFIG.model_copy(update={"method": method, **same}), self._slots, copies)
            for method in methods
        ]

    def go_on(self, tries: int, wanted: int, evenly: bool = False) -> TrialResult:
        """Search on by each method until there are `wanted` variants, or it has had so many more `tries`; `evenly`:
        no method finds more than its share of them while another can. Growth, whose shapes are all complete, gives up
        as soon as the first of them show nothing new."""
        left = [tries] * len(self._searches)
        if evenly:
            for number in range(len(self._searches)):
                self._go_on(number, wanted * (number + 1) // len(self._searches), tries, left)
        for number in range(len(self._searches)):
            self._go_on(number, wanted, tries, left)
        return self.finds()

    def _go_on(self, number: int, wanted: int, tries: int, left: list[int]) -> None:
        """Search on by one method, which has so many of its `tries` left; none, once it finds nothing."""
        search = self._searches[number]
        while left[number] > 0 and len(self.variants) < wanted:
            is_first = search.config.method == "growth" and left[number] == tries
            is_vain = not self.variants and self._slots is None and len(self._searches) > 1
            first = tries // (FIRST * VAIN if is_vain else FIRST)
            asked = max(first, 1) if is_first else left[number]
            missing = wanted - len(self.variants)
            found, used = search.run(self._rng, asked, missing, f"probe-{self._tries}", lambda _: None)
            self._tries += used
            left[number] = left[number] - used if found else 0
            whole = [each for each in found if self._is_whole(each.assembly)]
            telling = [each for each in whole if each.lineage["copied"]["share"] <= self._copied]
            keys = [search.key(each.assembly.types, each.graph, each.graph) for each in telling]
            self.variants.extend(each for each, key in zip(telling, keys, strict=True) if key not in self._known)
            self._known.update(keys)

    def _is_whole(self, assembly: Assembly) -> bool:
        """Whether a find has what makes it one; what it lacks is counted."""
        if not self._has_carcass(assembly):
            self._refused[LABELS_MISSING] += 1
            return False
        if self._hubs and not self._backdrop.has_hubs(self._hubs, self._backdrop.fit(assembly)):
            self._refused[HUBS_NOT_RESTORED] += 1
            return False
        return True

    def whole(self, place: int) -> Assembly:
        """The find at this place among the variants, with its backdrop."""
        return self._backdrop.fit(self.variants[place].assembly)

    def finds(self) -> TrialResult:
        """What was found so far."""
        rejects = sum((each.rejects for each in self._searches), self._refused)
        counts = type_counts(self.kit, [each.assembly.types for each in self.variants])
        exemplars = type_counts(self.kit, [each.assembly.types for each in self.kit.exemplars])
        if not self.variants:
            return TrialResult(self._tries, 0, 0, 0.0, 0.0, rejects=dict(rejects.most_common()))
        whole = np.array([each.lineage["copied"]["share"] for each in self.variants])
        taken = farthest_first(counts, exemplars, min(MAX_MOST_DIFFERENT, len(counts)))
        chosen = counts[taken]
        near = histogram_metric(chosen[:, None], exemplars[None]).min(axis=1)
        apart = histogram_metric(chosen[:, None], chosen[None])[np.triu_indices(len(chosen), 1)]
        return TrialResult(
            tries=self._tries,
            graphs=len(self.variants),
            histograms=len(np.unique(counts, axis=0)),
            distance=round(float(near.mean()), 4),
            spread=round(float(np.median(apart)), 4) if len(apart) else 0.0,
            copied=round(float(np.median(whole)), 4),
            telling=round(float(np.mean(whole <= NEAR_COPY_SHARE)), 4),
            observed_share=self._familiar([self.variants[place].assembly for place in taken.tolist()]),
            by_meaning=self.kit.by_meaning,
            most_different=tuple(taken.tolist()),
            rejects=dict(rejects.most_common()),
        )

    def _familiar(self, assemblies: Sequence[Assembly]) -> float:
        if self._slots is None:
            return 1.0
        return round(float(np.mean([self._slots.observed_share(each) for each in assemblies])), 4)


def type_counts(kit: Kit, shapes: Sequence[np.ndarray]) -> FloatArray:
    """Parts by type, float64 (k, types)."""
    counts = [np.bincount(each, minlength=len(kit.types)) for each in shapes]
    return np.array(counts, dtype=np.float64).reshape(-1, len(kit.types))
