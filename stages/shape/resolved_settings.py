"""The contract of auto-configuration: the names under which records hold what it resolved beyond a kit's own keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.stage import Plan

RESOLVED_HUB_SHARE = 0.5
"""Required share of hub parts where `auto` left hubs out: a mile of rail on one brick of road is no bridge."""

MAX_COPIED_SHARE_KEY = "require.max_copied_share"
STABLE_KEY = "require.stable"
REQUIRED_LABELS_KEY = "require.labels"
KEEP_TYPES_KEY = "require.keep_types"
FALLBACK_KEY = "fallback"
PROPORTIONS_FALLBACK, ROWS_FALLBACK = "proportions", "rows"
"""Values of FALLBACK_KEY: exemplars in other proportions, and those with longer and shorter rows too."""
FALLBACK_STABLE_KEY = "proportions.require.stable"


def resolved_settings(plan: Plan, kit: str) -> Mapping[str, Any]:
    """Return the settings resolved for a kit, by key; empty for a stated kit and before the kit is built."""
    summary = plan.summary("exemplars", kit)
    return dict(summary["resolved"]) if summary else {}
