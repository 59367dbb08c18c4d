"""Whether the exemplars of a dataset come in other proportions, for no other layouts can be made of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.exemplars.settings import ExemplarsConfig
from stages.variations.settings import FALLBACK_KEY, VariationsConfig


def allows_fallback(config: Config) -> bool:
    """Whether other proportions may come instead of layouts: of a single kit, for a dataset is made in one way."""
    section, kits = config.section(VariationsConfig), config.section(ExemplarsConfig).kits
    return bool(section.samples_per_kit and section.fallback == "auto" and len(kits) == 1 and kits[0].auto_keys())


def resolved_fallback(plan: Plan) -> Mapping[str, Any]:
    """What was chosen for the one kit whose exemplars come in other proportions; empty where they do not, or where
    nobody knows yet."""
    if not allows_fallback(plan.config):
        return {}
    (kit,) = plan.shards("exemplars")
    chosen: Mapping[str, Any] = (plan.summary("exemplars", kit) or {"resolved": {}})["resolved"]
    return chosen if FALLBACK_KEY in chosen else {}
