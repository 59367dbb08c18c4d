"""`README.md`: the dataset's card, with the metadata that Hugging Face reads and the text that people read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import yaml

from stages.package.layout import CHECKSUMS, CROISSANT, MANIFEST, PREVIEW
from stages.variations.measures import measure_table

__all__ = ["card", "citation", "member_text", "size_category"]

SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))

MADE = {
    "variations": "exemplar meshes are cut into parts, a tiling grammar is read off their contacts, and new shapes are "
    "made whose every neighbourhood and every docking of two parts was seen in an exemplar. A sample's `parents` are "
    "exemplars, or variants by the `name` in their own `lineage`.",
    "programs": "curve programs are run on parameters drawn from their ranges; a shape's parameters are its `txt`.",
    "shapeassembly": "ShapeAssembly programs are executed; a shape's program is its `txt`.",
}
"""How the samples of each producer come about."""

SPLITS = {
    "variations": "Samples whose shape graphs are equal stand in one split.",
    "programs": "No two samples are alike, within a split or across splits. In a plain sweep, samples that are alike "
    "up to their continuous parameters stand in one split, if their `lineage` says `apart: structure`; where it says "
    "`apart: values`, the program has fewer structures than there are splits, and shapes of one structure stand in all "
    "of them. Where every value of every parameter is sampled, all splits have all values, as published.",
    "shapeassembly": "Samples of programs that are alike up to their numbers stand in one split.",
}
"""What keeps the splits apart, for each producer."""

MEMBERS = {
    "glb": "The mesh: glTF 2.0, one node a part, named by its label (`tower.000`), equal parts sharing one mesh. Node "
    "`extras` hold `type` and `instance`.",
    "points.npy": "Point cloud, float32 (n, 3).",
    "normals.npy": "Unit normals of the points, float32 (n, 3).",
    "labels.npy": "Part label of each point, int16 (n,).",
    "instances.npy": "Part of each point, int16 (n,).",
    "txt": "The shape as text: of a kit its graph as strings, SMILES-like, one a line, the first canonical; else its "
    "parameters as JSON, or its program.",
    "json": "Everything else: parts with label, type and pose (4x4), contacts, counts, bounds, parents and lineage.",
}


def member_text(member: str) -> str:
    """What a member is, in words; every view of a sketch is a member of its own."""
    if member.startswith("sketch"):
        view = member.partition(".")[0].removeprefix("sketch")
        return f"Line drawing of the shape, view {view}, single-channel PNG."
    return MEMBERS.get(member, "")


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
    rows: Sequence[Mapping[str, Any]],
    producer: str,
    sources: Mapping[str, str],
    search: Sequence[str],
    rejects: Mapping[str, int],
    measures: Mapping[str, Mapping[str, Any]],
    recipes: Sequence[str],
) -> str:
    """The card's text.

    facts: name, version, title, description, license, creator, published, tags, task_categories; shards: summaries
    of the package's shards; rows: those of the index; producer: the stage that made the samples; sources: the kits or
    programs by name, with what there is to say of them in short; search: how each search ended, in words; rejects:
    refused items by reason; measures: of the variants of each kit; recipes: a section of Markdown for each program.
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
        SPLITS[producer],
        *(["## How different they are", measure_table(measures)] if measures else []),
        "## A sample",
        _member_table([str(member) for member in shards[0]["members"]]),
        "All coordinates are in the units of the kit or program and upright: y points up, in the mesh, the points and "
        "the poses alike. "
        "Points lie on every part's whole surface, also where it is hidden inside another part. Vertex colours of the "
        "mesh are linear, as glTF asks. No key holds a dot, no value is null, and each sample has all members.",
        "## Loading it",
        _loading(facts, splits, shards),
        "## How it was made",
        f"By Shapemill: {MADE[producer]} `{MANIFEST}` holds the whole config.",
        *([_list(search)] if search else []),
        *([_reject_table(rejects)] if rejects else []),
        *recipes,
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


def _span(numbers: Sequence[int]) -> str:
    return f"{min(numbers)} / {median(numbers):g} / {max(numbers)}" if numbers else "-"


def _member_table(members: Sequence[str]) -> str:
    lines = ["| member | what it is |", "| --- | --- |"]
    lines += [f"| `<key>.{member}` | {member_text(member)} |" for member in members]
    return "\n".join(lines)


def _reject_table(rejects: Mapping[str, int]) -> str:
    lines = ["| refused because | tries |", "| --- | ---: |"]
    lines += [f"| {reason} | {count:,} |" for reason, count in sorted(rejects.items(), key=lambda each: -each[1])]
    return "\n".join(lines)


def _list(sentences: Sequence[str]) -> str:
    return "\n".join(f"- {sentence}" for sentence in sentences)


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
