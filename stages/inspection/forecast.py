"""The forecast by kind: new plans, longer and shorter shapes and other proportions; and what is typical."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stages.autoconfig.resize_fallback import MAX_LAYOUTS_TRIED, Kind, ResizeEstimate
from stages.autoconfig.trial_search import type_counts
from stages.autoconfig.yield_estimate import MAX_ESTIMATE_GRAPHS, MAX_SAMPLES_REQUESTED, YieldEstimate, rounded_text
from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE
from stages.variations.report.measures import have_new_plans
from stages.variations.requirements.identity import label_counts
from stages.variations.search.variant import Variant

TITLES: dict[Kind, str] = {
    "new plan": "new plans",
    "longer or shorter": "longer and shorter",
    "other proportions": "other proportions",
}
ALWAYS_SHARE = 0.95
"""Labels in at least this share of the hits are not listed as missing."""
MAX_LABELS_LISTED = 5


@dataclass(frozen=True)
class Forecast:
    """What a run makes of a kit, by kind.

    shares: share of each kind in what a run makes.
    numbers: estimated number of each kind.
    is_bound: whether each number is only a lower bound.
    typical: what the bulk is like, a sentence.
    """

    shares: dict[Kind, float]
    numbers: dict[Kind, int]
    is_bound: dict[Kind, bool]
    typical: str

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield title and text of each kind that is expected, and of what is typical."""
        for kind, number in self.numbers.items():
            if number:
                more = " or more" if self.is_bound[kind] else ""
                yield TITLES[kind], f"{rounded_text(number)}{more}, {self.shares[kind]:.0%} of what is made"
        if self.typical:
            yield "typical", self.typical


def kind_of(variant: Variant) -> Kind:
    """Return what is new in a variant: its plan, or only its length or width."""
    pieces = np.array([variant.lineage["copied"]["pieces"]])
    return "new plan" if have_new_plans(variant.features[None], pieces)[0] else "longer or shorter"


def forecast(kit: Kit, layouts: YieldEstimate | None, resizing: ResizeEstimate | None) -> Forecast:
    """Return the forecast by kind. resizing: of the fallback, if there is one: then no layouts are made."""
    if resizing is not None:
        return _of_resizing(resizing)
    if layouts is None or not layouts.variants:
        return Forecast({}, {}, {}, "")
    likely = layouts.likely_variants(kit)
    kinds = [kind_of(variant) for variant in likely]
    total = (MAX_ESTIMATE_GRAPHS if layouts.layouts is None else layouts.layouts) + len(layouts.row_variants)
    shares = {kind: kinds.count(kind) / len(kinds) for kind in TITLES if kind in kinds}
    numbers = {kind: max(1, round(share * total)) for kind, share in shares.items()}
    return Forecast(shares, numbers, dict.fromkeys(shares, True), _typical(kit, likely))


def _of_resizing(resizing: ResizeEstimate) -> Forecast:
    """Return the forecast of resized exemplars."""
    shares: dict[Kind, float] = {"other proportions": 1.0}
    if resizing.has_rows:
        shares = {kind: resizing.shares[kind] for kind in TITLES if kind in resizing.shares}
    numbers = {kind: max(1, resizing.layouts.get(kind, 0)) for kind in shares}
    is_bound = dict.fromkeys(shares, resizing.other_layouts >= MAX_LAYOUTS_TRIED)
    if "other proportions" in shares:
        numbers["other proportions"] = resizing.different
        is_bound["other proportions"] = resizing.different >= MAX_SAMPLES_REQUESTED
    return Forecast(shares, numbers, is_bound, "")


def _typical(kit: Kit, variants: Sequence[Variant]) -> str:
    """Return the usual size of variants, how much of an exemplar is whole in them, and which labels they lack."""
    counts = type_counts(kit, [variant.assembly.types for variant in variants]).astype(np.int64)
    sizes = " and ".join(str(len(exemplar.assembly)) for exemplar in kit.exemplars)
    median = float(np.median(counts.sum(axis=1)))
    sentences = [f"half have {median:.0f} parts or more, the exemplar{'s' * (len(kit.exemplars) > 1)} {sizes}"]
    whole = [variant.lineage["copied"]["exemplar_share"] > NEAR_COPY_SHARE for variant in variants]
    if any(whole):
        sentences.append(f"{np.mean(whole):.0%} hold nearly a whole exemplar in one piece")
    present: FloatArray = np.mean(label_counts(kit, counts) > 0, axis=0)
    exemplars = type_counts(kit, [exemplar.assembly.types for exemplar in kit.exemplars]).astype(np.int64)
    known = label_counts(kit, exemplars).sum(axis=0)
    rare = [index for index in np.argsort(present, kind="stable").tolist() if known[index]]
    rare = [index for index in rare if present[index] < ALWAYS_SHARE]
    listed = ", ".join(f"{present[index]:.0%} a {kit.labels[index]}" for index in rare[:MAX_LABELS_LISTED])
    if listed:
        others = len(rare) - MAX_LABELS_LISTED
        sentences.append(f"only {listed}" + (f", and {others} more" if others > 0 else ""))
    return "; ".join(sentences)
