"""Kits whose configs state every key, so that no test waits for a trial search."""

from __future__ import annotations

from typing import Any


def stated(kit: dict[str, Any]) -> dict[str, Any]:
    """Return the kit of a config with every key that may be `auto` stated; missing ones get the strictest value."""
    contact = {"tolerance": 0.001, "kinds": ["point", "line", "face"], **kit.get("contact", {})}
    hubs = {"types": "none", **kit.get("hubs", {})}
    return {"up": "y", "grammar": "multiset", "disconnected": "error", **kit, "contact": contact, "hubs": hubs}
