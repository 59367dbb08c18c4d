"""`README.md`: the dataset's card, with the metadata that Hugging Face reads and the text that people read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import yaml

from stages.package.layout import CHECKSUMS, CLASSES, CROISSANT, MANIFEST, PREVIEW

__all__ = ["Story", "card", "citation", "size_category"]

LISTED_CLASSES = 60
"""Of more classes than these, the card lists the first."""
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


@dataclass(frozen=True)
class Story:
    """How a dataset was made, in the words of its producer.

    made: how its samples come about; splits: what keeps the splits apart; paragraphs, variety: Markdown; rejects:
    refused items by reason.
    """

    made: str
    splits: str
    paragraphs: Sequence[str]
    variety: Sequence[str]
    rejects: Mapping[str, int]


def citation(facts: Mapping[str, Any]) -> str:
    """How to cite the dataset, as BibTeX on one line."""
    year = str(facts["published"])[:4]
    return (
        f"@misc{{{facts['name']}, title={{{facts['title']}}}, author={{{facts['creator']}}}, year={{{year}}}, "
        f"version={{{facts['version']}}}}}"
    )


def size_category(samples: int) -> str:
    """Hugging Face's name for a dataset of this size."""
    return next((name for limit, name in SIZES if samples < limit), "n>1M")


def card(
    facts: Mapping[str, Any],
    shards: Sequence[Mapping[str, Any]],
    members: Sequence[Mapping[str, Any]],
    rows: Sequence[Mapping[str, Any]],
    sources: Mapping[str, str],
    classes: Sequence[Mapping[str, Any]],
    story: Story,
) -> str:
    """The card's text.

    facts: name, version, title, description, license, creator, published, tags, task_categories; shards: summaries
    of the package's shards; members: name, sentence, dtype and shape of each; rows: those of the index; sources: the
    kits or programs by name, with what there is to say of them in short; classes: the rows of `classes.json`.
    """
    splits = list(dict.fromkeys(str(shard["split"]) for shard in shards))
    header = {
        "license": str(facts["license"]).lower(),
        "pretty_name": facts["title"],
        "task_categories": list(facts["task_categories"]),
        "size_categories": [size_category(len(rows))],
        "tags": list(dict.fromkeys([*facts["tags"], *sources])),
        "configs": [
            {
                "config_name": "default",
                "data_files": [{"split": split, "path": f"data/{split}/*.tar"} for split in splits],
            }
        ],
    }
    sections = [
        f"# {facts['title']}",
        f"![Shapes, their points and their sketches]({PREVIEW})",
        str(facts["description"]),
        "## What is in it",
        _split_table(splits, shards),
        _source_table(sources, rows),
        story.splits,
        "## Part labels",
        _class_table(classes, splits),
        *(["## How different they are", *story.variety] if story.variety else []),
        "## A sample",
        _member_table(members),
        "All coordinates are in the units of the kit or program and upright: y points up, in the mesh, the points and "
        "the poses alike. "
        "Points lie on every part's whole surface, also where it is hidden inside another part. Vertex colours of the "
        "mesh are linear, as glTF asks. No key holds a dot, no value is null, and each sample has all members.",
        "## Loading it",
        _loading(facts, splits, shards),
        "## How it was made",
        f"By Shapemill: {story.made} `{MANIFEST}` holds the whole config.",
        *([_reject_table(story.rejects)] if story.rejects else []),
        *story.paragraphs,
        "## Checking it",
        f"`sha256sum -c {CHECKSUMS}` compares every file; `make verify` also computes contacts anew from the meshes.",
        "## Licence and citation",
        f"{facts['license']}.",
        f"```bibtex\n{citation(facts)}\n```",
    ]
    front = yaml.safe_dump(header, sort_keys=False, allow_unicode=True, width=1000)
    return f"---\n{front}---\n\n" + "\n\n".join(sections) + "\n"


def _split_table(splits: Sequence[str], shards: Sequence[Mapping[str, Any]]) -> str:
    lines = ["| split | samples | shards | MB |", "| --- | ---: | ---: | ---: |"]
    for split in [*splits, "all"]:
        own = [shard for shard in shards if split in ("all", shard["split"])]
        size = sum(shard["bytes"] for shard in own) / 1e6
        lines.append(f"| {split} | {sum(shard['samples'] for shard in own):,} | {len(own)} | {size:,.1f} |")
    return "\n".join(lines)


def _source_table(sources: Mapping[str, str], rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        "| made of | samples | distinct structures | parts | contacts | cycles | rooted | stable |",
        "| --- | ---: | ---: | --- | --- | --- | ---: | ---: |",
    ]
    for name, described in sources.items():
        own = [row for row in rows if row["kit"] == name]
        spans = " | ".join(_span([row[each] for row in own]) for each in ("parts", "contacts", "cycles"))
        structures = len({row["graph"] for row in own})
        title = f"{name} ({described})" if described else name
        shares = " | ".join(f"{sum(row[each] for row in own) / len(own):.1%}" for each in ("rooted", "stable"))
        lines.append(f"| {title} | {len(own):,} | {structures:,} | {spans} | {shares} |")
    return (
        "\n".join(lines) + "\n\nParts, contacts and independent cycles: least, median, most. Rooted: every part is "
        "connected to the ground. Stable: the shape stands and bears small pushes, by statics on its geometry."
    )


def _class_table(classes: Sequence[Mapping[str, Any]], splits: Sequence[str]) -> str:
    lines = [
        f"A label has one id, its class, in all members and splits. `{CLASSES}` lists them all; shapes and parts that "
        f"have a label: {' / '.join(splits)}.\n",
        "| class | label | of | color | shapes | parts |",
        "| ---: | --- | --- | --- | ---: | ---: |",
    ]
    for each in classes[:LISTED_CLASSES]:
        counts = (" / ".join(f"{each[what][split]:,}" for split in splits) for what in ("shapes", "parts"))
        lines.append(f"| {each['id']} | {each['name']} | {each['kit']} | `{each['color']}` | {' | '.join(counts)} |")
    more = len(classes) - LISTED_CLASSES
    return "\n".join([*lines, *([f"\nAnd {more:,} more."] if more > 0 else [])])


def _span(numbers: Sequence[int]) -> str:
    return f"{min(numbers)} / {median(numbers):g} / {max(numbers)}" if numbers else "-"


def _member_table(members: Sequence[Mapping[str, Any]]) -> str:
    lines = ["| member | array | what it is |", "| --- | --- | --- |"]
    for each in members:
        array = f"{each['dtype']} ({', '.join(map(str, each['shape']))})" if each["dtype"] else ""
        lines.append(f"| `<key>.{each['name']}` | {array} | {each['sentence']} |")
    return "\n".join(lines)


def _reject_table(rejects: Mapping[str, int]) -> str:
    lines = ["| refused because | tries |", "| --- | ---: |"]
    lines += [f"| {reason} | {count:,} |" for reason, count in sorted(rejects.items(), key=lambda each: -each[1])]
    return "\n".join(lines)


def _loading(facts: Mapping[str, Any], splits: Sequence[str], shards: Sequence[Mapping[str, Any]]) -> str:
    name, split = facts["name"], splits[0]
    count = sum(1 for shard in shards if shard["split"] == split)
    stem = str(shards[0]["path"]).rpartition("-")[0]
    pattern = f"{name}/{stem}-{{{0:06d}..{count - 1:06d}}}.tar"
    return f"""```python
# WebDataset, also below a torch DataLoader
import webdataset
samples = webdataset.WebDataset("{pattern}", shardshuffle=False).decode()
for sample in samples:
    sample["points.npy"], sample["labels.npy"], sample["txt"], sample["json"]["parts"]

# torch
from torch.utils.data import DataLoader
loader = DataLoader(samples.to_tuple("points.npy", "labels.npy").batched(16), batch_size=None, num_workers=4)

# Hugging Face
import datasets
samples = datasets.load_dataset("{name}", split="{split}")

# Croissant: each member is a record set of `key` and `content`
import mlcroissant
records = mlcroissant.Dataset("{name}/{CROISSANT}").records("points")

# the mesh of a sample
import io, trimesh
scene = trimesh.load(io.BytesIO(sample["glb"]), file_type="glb")   # from webdataset without .decode()

# one sample without reading its shard
import io, pyarrow.parquet, tarfile
row = pyarrow.parquet.read_table("{name}-index/{name}.parquet").to_pylist()[0]
with open("{name}/" + row["shard"], "rb") as shard:
    shard.seek(row["offset"])
    members = tarfile.open(fileobj=io.BytesIO(shard.read(row["bytes"])))
```"""
