"""What a dataset's card says of the keys that were chosen for its kits."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.stage import Plan


def resolved_table(plan: Plan) -> Sequence[str]:
    """What was chosen for each kit whose config left keys open, and why, as a table."""
    rows = []
    for kit in plan.shards("exemplars"):
        summary = plan.summary("exemplars", kit) or {"resolved": {}}
        for key, value in summary["resolved"].items():
            shown = ", ".join(value) if isinstance(value, list) else value
            rows.append(f"| {kit} | `{key}` | {shown} | {summary['reasons'][key]} |")
    if not rows:
        return []
    return ["\n".join(["| kit | key | chosen | why |", "|---|---|---|---|", *rows])]
