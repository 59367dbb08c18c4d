"""Report on the splits: how many samples each has of those asked for, and how near they are to train."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def shortage(measures: Mapping[str, Any]) -> str:
    """Return which splits of a kit have fewer samples than asked for, in words; empty where none has."""
    short = {name: split for name, split in measures["splits"].items() if split["samples"] < split["wanted"]}
    return ", ".join(f"{name} {split['samples']:,} of {split['wanted']:,}" for name, split in short.items())


def splits_table(measures: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the splits of each kit as Markdown: a table, what its figures mean, and what came out short.

    measures: by kit `pool`, `split_by`, `min_shared_surface`, `discarded` and `splits`: of each split `wanted` and
        `samples`, and of val and test `compared`, `median` and `most`
    """
    lines = [
        "| kit | split | samples | asked for | shared with train, median | most |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
    ]
    for kit, own in measures.items():
        for name, split in own["splits"].items():
            shared = f"{split['median']:.0%} | {split['most']:.0%}" if "median" in split else " | "
            lines.append(f"| {kit} | {name} | {split['samples']:,} | {split['wanted']:,} | {shared} |")
    lines += ["", _rule(next(iter(measures.values()))), ""]
    for kit, own in measures.items():
        short = shortage(own)
        discarded = f"- {kit}: {own['discarded']:,} of {own['pool']:,} variants were too near to another split"
        if own["split_by"] == "family":
            lines.append(f"{discarded}; fewer than asked for: {short}" if short else discarded)
        elif short:
            lines.append(f"- {kit}: fewer than asked for: {short}")
    return "\n".join(lines)


def _rule(measures: Mapping[str, Any]) -> str:
    measure = (
        "Shared with train: the surface that a shape has in common with the nearest shape of train, as a share of the "
        "larger one, when they are laid on each other as well as possible (parts of one type with one centroid "
        "coincide); for some shapes of each split."
    )
    if measures["split_by"] == "graph":
        return f"Samples with equal shape graphs are in one split; near relatives can be in several. {measure}"
    return (
        f"No two samples of different splits share {measures['min_shared_surface']:.0%} of their surface or more, are "
        f"parent and child, siblings of one cut, or equal in their shape graphs. {measure}"
    )
