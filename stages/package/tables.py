"""Tables of the dataset card, as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stages.package.layout import CLASSES
from stages.package.sources import RANGES, SourceTally

MAX_CLASSES_LISTED = 60


def split_table(splits: Sequence[str], shards: Sequence[Mapping[str, Any]]) -> str:
    """Return samples, shards and size of each split."""
    lines = ["| split | samples | shards | MB |", "| --- | ---: | ---: | ---: |"]
    for split in [*splits, "total"]:
        own = [shard for shard in shards if split in ("total", shard["split"])]
        size = sum(shard["bytes"] for shard in own) / 1e6
        lines.append(f"| {split} | {sum(shard['samples'] for shard in own):,} | {len(own)} | {size:,.1f} |")
    return "\n".join(lines)


def class_table(classes: Sequence[Mapping[str, Any]], splits: Sequence[str]) -> str:
    """Return the first classes, with the numbers of shapes and parts in each split."""
    lines = [
        f"A label has one class id in all members and splits. `{CLASSES}` lists all of them. Columns shapes and parts "
        f"count {' / '.join(splits)}.\n",
        "| class | label | source | color | shapes | parts |",
        "| ---: | --- | --- | --- | ---: | ---: |",
    ]
    for row in classes[:MAX_CLASSES_LISTED]:
        counts = (" / ".join(f"{row[what][split]:,}" for split in splits) for what in ("shapes", "parts"))
        lines.append(f"| {row['id']} | {row['name']} | {row['kit']} | `{row['color']}` | {' | '.join(counts)} |")
    more = len(classes) - MAX_CLASSES_LISTED
    return "\n".join([*lines, *([f"\nAnd {more:,} more."] if more > 0 else [])])


def source_table(sources: Mapping[str, str], tallies: Mapping[str, SourceTally]) -> str:
    """Return statistics of each kit or program with samples."""
    lines = [
        "| source | samples | distinct structures | parts | contacts | cycles | rooted | stable |",
        "| --- | ---: | ---: | --- | --- | --- | ---: | ---: |",
    ]
    for name, description in sources.items():
        own = tallies[name]
        spans = " | ".join(own.span(column) for column in RANGES)
        title = f"{name} ({description})" if description else name
        shares = " | ".join(f"{count / own.samples:.1%}" for count in (own.rooted, own.stable))
        lines.append(f"| {title} | {own.samples:,} | {own.structures:,} | {spans} | {shares} |")
    return (
        "\n".join(lines) + "\n\nParts, contacts and cycles: minimum / median / maximum in a shape. Contacts: pairs of "
        "parts that touch. Cycles: independent cycles of the contact graph. Rooted: every part is connected to the "
        "ground. Stable: the shape stands and withstands small pushes, by statics on its geometry."
    )


def member_table(members: Sequence[Mapping[str, Any]]) -> str:
    """Return name, type, shape and description of each member."""
    lines = ["| member | array | description |", "| --- | --- | --- |"]
    for member in members:
        array = f"{member['dtype']} ({', '.join(map(str, member['shape']))})" if member["dtype"] else ""
        lines.append(f"| `<key>.{member['name']}` | {array} | {member['sentence']} |")
    return "\n".join(lines)


def origin_table(origins: Sequence[Mapping[str, Any]]) -> str:
    """Return author, source, licence and notice of each file that the dataset was made from."""
    lines = [
        "| file | kit | author | source | licence | notice | sha256 |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for origin in origins:
        author, source, notice = (_cell(origin[name]) for name in ("author", "source", "notice"))
        license = _cell(origin["license"]) or "not stated"
        digest = f"`{origin['sha256'][:12]}…`"
        lines.append(f"| {origin['file']} | {origin['kit']} | {author} | {source} | {license} | {notice} | {digest} |")
    return "\n".join(lines)


def reject_table(rejects: Mapping[str, int]) -> str:
    """Return the number of refused tries by reason."""
    lines = ["| reason of refusal | tries |", "| --- | ---: |"]
    lines += [f"| {reason} | {count:,} |" for reason, count in sorted(rejects.items(), key=lambda item: -item[1])]
    return "\n".join(lines)


def _cell(text: str) -> str:
    """Format a text for a table cell."""
    return " ".join(text.split()).replace("|", "\\|")
