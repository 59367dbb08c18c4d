"""Variants of a kit in memory, without a dataset: one search from the exemplars."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly, Kit
from stages.variations.search.search import Search
from stages.variations.settings import SearchConfig


def vary(kit: Kit, count: int, rng: np.random.Generator, config: SearchConfig | None = None) -> list[Assembly]:
    """Return `count` new assemblies of the kit's parts, or fewer where `config.tries_per_round` tries find no more.

    Every neighbourhood and every contact occurs in the exemplars, by the kit's grammar. No two assemblies are the same
    by `config.duplicates`, and none is a piece of an exemplar unless `config.sub_assemblies`. Hubs are not restored.
    """
    search = Search(ContactOracle(kit), config or SearchConfig())
    variants, _ = search.run(rng, search.config.tries_per_round, count, kit.name, lambda _: None)
    return [variant.assembly for variant in variants[:count]]
