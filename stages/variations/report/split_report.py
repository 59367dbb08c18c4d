"""What became of the splits: how many samples each has of those asked for, and how near its samples are to train."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def shortage(measures: Mapping[str, Any]) -> str:
    """Which splits of a kit have fewer samples than asked for, in words; empty where none has."""
    short = {split: each for split, each in measures["splits"].items() if each["samples"] < each["wanted"]}
    return ", ".join(f"{split} {each['samples']:,} of {each['wanted']:,}" for split, each in short.items())


def splits_table(measures: Mapping[str, Mapping[str, Any]]) -> str:
    """The splits of each kit as Markdown: a table, what its figures mean, and what came out short.

    measures: of each kit, by name, `splits`: of each split `wanted` and `samples`, and of val and test `compared`,
    `median` and `most`; `split_by`, `split_near` and `let_go`.
    """
    lines = [
        "| kit | split | samples | asked for | shared with train, median | most |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
    ]
    for kit, each in measures.items():
        for split, found in each["splits"].items():
            shared = f"{found['median']:.0%} | {found['most']:.0%}" if "median" in found else " | "
            lines.append(f"| {kit} | {split} | {found['samples']:,} | {found['wanted']:,} | {shared} |")
    lines += ["", _rule(next(iter(measures.values()))), ""]
    for kit, each in measures.items():
        short = shortage(each)
        told = f"- {kit}: {each['let_go']:,} of {each['pool']:,} variants found stood too near to another split"
        if each["split_by"] == "family":
            lines.append(f"{told}; fewer than asked for: {short}" if short else told)
        elif short:
            lines.append(f"- {kit}: fewer than asked for: {short}")
    return "\n".join(lines)


def _rule(measures: Mapping[str, Any]) -> str:
    measure = (
        "Shared with train: the part of its surface that a shape has in common with the nearest shape of train, of the "
        "larger of the two, laid upon each other as well as may be (parts of one type with one centroid coincide); "
        "over some of each split."
    )
    if measures["split_by"] == "graph":
        return (
            f"Samples whose shape graphs are equal stand in one split; near relatives may stand in several. {measure}"
        )
    return (
        f"No two samples of different splits share {measures['split_near']:.0%} of their surface or more, are parent "
        f"and child, siblings of one cut, or equal in their shape graphs. {measure}"
    )
