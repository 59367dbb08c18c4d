"""The table of resolved settings on a dataset's card."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.stage import Plan


def resolved_table(plan: Plan) -> Sequence[str]:
    """Return a Markdown table of the settings resolved for each kit, with their reasons; empty if none were."""
    rows = []
    for kit in plan.shards("exemplars"):
        summary = plan.summary("exemplars", kit) or {"resolved": {}}
        for key, value in summary["resolved"].items():
            shown = ", ".join(value) if isinstance(value, list) else value
            rows.append(f"| {kit} | `{key}` | {shown} | {summary['reasons'][key]} |")
    return ["\n".join(["| kit | key | value | why |", "|---|---|---|---|", *rows])] if rows else []
