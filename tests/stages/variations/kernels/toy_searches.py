"""Searches on toy kits by every method, as JSON: python -m tests.stages.variations.kernels.toy_searches

With NUMBA_DISABLE_JIT=1 the compiled code is interpreted, with real tracebacks.
"""

from __future__ import annotations

import json

import numpy as np

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.variations.search.search import Search
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, ring

TRIES = {"exchange": 60, "growth": 300, "substructures": 40}


def toy_searches() -> str:
    """Return the keys of all variants and the rejects of each search, as JSON."""
    kits = {"chains": kit_of(CHAIN, [chain(3), chain(5)]), "rings": kit_of(ROAD, [ring(1, 1), ring(1, 2)])}
    found = {}
    for name, kit in kits.items():
        for method, tries in TRIES.items():
            search = Search(ContactOracle(kit), SearchConfig.model_validate({"method": method}))
            variants, _ = search.run(np.random.default_rng(3), tries, 10**9, "test", lambda _: None)
            found[f"{name} by {method}"] = [variant.docked for variant in variants], dict(search.rejects)
    return json.dumps(found)


if __name__ == "__main__":
    print(toy_searches())
