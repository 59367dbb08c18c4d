"""The tables of a dataset's card, as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stages.package.layout import CLASSES
from stages.package.sources import RANGES, SourceTally

MAX_CLASSES_LISTED = 60
"""So many classes at most stand in the card."""


def split_table(splits: Sequence[str], shards: Sequence[Mapping[str, Any]]) -> str:
    """Samples, shards and size of each split."""
    lines = ["| split | samples | shards | MB |", "| --- | ---: | ---: | ---: |"]
    for split in [*splits, "all"]:
        own = [shard for shard in shards if split in ("all", shard["split"])]
        size = sum(shard["bytes"] for shard in own) / 1e6
        lines.append(f"| {split} | {sum(shard['samples'] for shard in own):,} | {len(own)} | {size:,.1f} |")
    return "\n".join(lines)


def class_table(classes: Sequence[Mapping[str, Any]], splits: Sequence[str]) -> str:
    """The first of the classes, with how many shapes and parts of each split have them."""
    lines = [
        f"A label has one id, its class, in all members and splits. `{CLASSES}` lists them all; shapes and parts that "
        f"have a label: {' / '.join(splits)}.\n",
        "| class | label | of | color | shapes | parts |",
        "| ---: | --- | --- | --- | ---: | ---: |",
    ]
    for each in classes[:MAX_CLASSES_LISTED]:
        counts = (" / ".join(f"{each[what][split]:,}" for split in splits) for what in ("shapes", "parts"))
        lines.append(f"| {each['id']} | {each['name']} | {each['kit']} | `{each['color']}` | {' | '.join(counts)} |")
    more = len(classes) - MAX_CLASSES_LISTED
    return "\n".join([*lines, *([f"\nAnd {more:,} more."] if more > 0 else [])])


def source_table(sources: Mapping[str, str], tallies: Mapping[str, SourceTally]) -> str:
    """What the samples of each kit or program are like; `tallies` counts those that have samples."""
    lines = [
        "| made of | samples | distinct structures | parts | contacts | cycles | rooted | stable |",
        "| --- | ---: | ---: | --- | --- | --- | ---: | ---: |",
    ]
    for name, described in sources.items():
        own = tallies[name]
        spans = " | ".join(own.span(each) for each in RANGES)
        title = f"{name} ({described})" if described else name
        shares = " | ".join(f"{count / own.samples:.1%}" for count in (own.rooted, own.stable))
        lines.append(f"| {title} | {own.samples:,} | {own.structures:,} | {spans} | {shares} |")
    return (
        "\n".join(lines) + "\n\nParts, contacts and cycles: least / median / most in a shape. Contacts: pairs of parts "
        "that touch. Cycles: independent rings that the contacts close. Rooted: every part is connected to the ground. "
        "Stable: the shape stands and bears small pushes, by statics on its geometry."
    )


def member_table(members: Sequence[Mapping[str, Any]]) -> str:
    """What each sample holds: name, type and shape, and a sentence."""
    lines = ["| member | array | what it is |", "| --- | --- | --- |"]
    for each in members:
        array = f"{each['dtype']} ({', '.join(map(str, each['shape']))})" if each["dtype"] else ""
        lines.append(f"| `<key>.{each['name']}` | {array} | {each['sentence']} |")
    return "\n".join(lines)


def origin_table(origins: Sequence[Mapping[str, Any]]) -> str:
    """Of each file that the dataset was made from whose it is, and what its licence asks to be said."""
    lines = [
        "| made from | of | author | source | licence | notice | sha256 |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for each in origins:
        author, source, notice = (_cell(each[name]) for name in ("author", "source", "notice"))
        license = _cell(each["license"]) or "not stated"
        digest = f"`{each['sha256'][:12]}…`"
        lines.append(f"| {each['file']} | {each['kit']} | {author} | {source} | {license} | {notice} | {digest} |")
    return "\n".join(lines)


def reject_table(rejects: Mapping[str, int]) -> str:
    """How many tries were refused, by reason."""
    lines = ["| refused because | tries |", "| --- | ---: |"]
    lines += [f"| {reason} | {count:,} |" for reason, count in sorted(rejects.items(), key=lambda each: -each[1])]
    return "\n".join(lines)


def _cell(text: str) -> str:
    """A text in one cell of a table."""
    return " ".join(text.split()).replace("|", "\\|")
