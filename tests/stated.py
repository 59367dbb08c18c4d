"""Kits whose configs leave nothing open, so that no test waits for a probe that it does not ask for."""

from __future__ import annotations

from typing import Any


def stated(kit: dict[str, Any]) -> dict[str, Any]:
    """The kit of a config with every key that may be `auto` typed out, the strictest where it says nothing."""
    contact = {"tolerance": 0.001, "kinds": ["point", "line", "face"], **kit.get("contact", {})}
    hubs = {"types": "none", **kit.get("hubs", {})}
    return {"up": "y", "grammar": "multiset", "disconnected": "error", **kit, "contact": contact, "hubs": hubs}
