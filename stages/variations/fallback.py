"""Whether the exemplars of a dataset are resized because no other layouts can be made of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.resolved_settings import FALLBACK_KEY, resolved_settings
from stages.variations.settings import VariationsConfig


def allows_fallback(config: Config) -> bool:
    """Return whether resized exemplars may replace new layouts: for a single kit that leaves a key at `auto`."""
    section, kits = config.section(VariationsConfig), config.section(ExemplarsConfig).kits
    return bool(section.samples_per_kit and section.fallback == "auto" and len(kits) == 1 and kits[0].auto_keys())


def resolved_fallback(plan: Plan) -> Mapping[str, Any]:
    """Return the resolved settings of the one kit that is resized; empty where none is, or nothing is resolved yet."""
    if not allows_fallback(plan.config):
        return {}
    (kit,) = plan.shards("exemplars")
    resolved = resolved_settings(plan, kit)
    return resolved if FALLBACK_KEY in resolved else {}
