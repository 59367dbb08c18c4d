"""`README.md`: the dataset card, with metadata for Hugging Face and text for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from stages.package.layout import CHECKSUMS, CROISSANT, MANIFEST, PREVIEW, SCHEMA, VERIFIER
from stages.package.sources import SourceTally
from stages.package.tables import class_table, member_table, origin_table, reject_table, source_table, split_table

SIZE_CATEGORIES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))

USES = (
    "For training and evaluating models that generate, complete, segment or reconstruct shapes made of parts, and for "
    "work on the structure and the physical validity of shapes. Not for conclusions about the look or construction "
    "of real objects, and not for judging whether a real object is safe."
)
LIMITS = (
    "All samples were made automatically, and no person has reviewed them.",
    "Stability is computed by statics with one density everywhere. Nothing was simulated or built.",
)
LOADED = ("points.npy", "labels.npy", "color0.png", "depth0.png", "txt")
"""Members that the example of loading reads, where samples have them."""
PICTURED = {f"{kind}0.png" for kind in ("color", "depth", "normals", "instances", "classes")}
PICTURES = """
# an image with all its bits: `.decode("pil")` would leave 8 of 16
import io
from PIL import Image
image = Image.open(io.BytesIO(sample["{}"]))
"""


@dataclass(frozen=True)
class CardText:
    """Text of a card from the dataset's producer and language.

    kits: names of kits and programs with samples
    made: how the samples are made
    splits: paragraphs on the separation of the splits
    coordinates: their unit and origin
    members_coordinates: sentences on the coordinates of members
    checks: what only `make verify` checks of the members
    limits: limitations, a sentence each
    paragraphs, variety: Markdown
    rejects: number of refused items by reason
    origins: the files that the dataset was made from, with author and licence
    missing_licenses: a sentence for each origin without a licence
    """

    kits: Sequence[str]
    made: str
    splits: Sequence[str]
    coordinates: str
    members_coordinates: Sequence[str]
    checks: Sequence[str]
    limits: Sequence[str]
    paragraphs: Sequence[str]
    variety: Sequence[str]
    rejects: Mapping[str, int]
    origins: Sequence[Mapping[str, Any]]
    missing_licenses: Sequence[str]


def citation(facts: Mapping[str, Any]) -> str:
    """Return the citation as BibTeX on one line."""
    year = str(facts["published"])[:4]
    return (
        f"@misc{{{facts['name']}, title={{{facts['title']}}}, author={{{facts['creator']}}}, year={{{year}}}, "
        f"version={{{facts['version']}}}}}"
    )


def size_category(samples: int) -> str:
    """Return Hugging Face's name for a dataset of this size."""
    return next((name for limit, name in SIZE_CATEGORIES if samples < limit), "n>1M")


def card(
    facts: Mapping[str, Any],
    shards: Sequence[Mapping[str, Any]],
    members: Sequence[Mapping[str, Any]],
    tallies: Mapping[str, SourceTally],
    sources: Mapping[str, str],
    classes: Sequence[Mapping[str, Any]],
    text: CardText,
) -> str:
    """Return the card.

    facts: name, version, title, description, license, creator, published, tags, task_categories
    shards: summaries of the package's shards
    members: name, sentence, dtype and shape of each
    tallies: statistics of the index for each kit or program
    sources: a short description of each kit or program, by name
    classes: rows of `classes.json`
    """
    splits = list(dict.fromkeys(str(shard["split"]) for shard in shards))
    names = [str(member["name"]) for member in members]
    points = "points.npy" in names
    pictured = " and their ".join(["Shapes, their points" if points else "Shapes", *_pictured(names)])
    header = {
        "license": str(facts["license"]).lower(),
        "pretty_name": facts["title"],
        **({"task_categories": list(facts["task_categories"])} if facts["task_categories"] else {}),
        "size_categories": [size_category(sum(tally.samples for tally in tallies.values()))],
        "tags": list(dict.fromkeys([*facts["tags"], *text.kits])),
        "configs": [
            {
                "config_name": "default",
                "data_files": [{"split": split, "path": f"data/{split}/*.tar"} for split in splits],
            }
        ],
    }
    sections = [
        f"# {facts['title']}",
        f"![{pictured}]({PREVIEW})",
        str(facts["description"]),
        "## Contents",
        split_table(splits, shards),
        source_table(sources, tallies),
        "## Splits",
        *text.splits,
        "## Part labels",
        class_table(classes, splits),
        *(["## Diversity", *text.variety] if text.variety else []),
        "## A sample",
        member_table(members),
        f"`{SCHEMA}` describes each field of the JSON. No key holds a dot, no value is null or empty, and each sample "
        f"has all members and all fields. {'Instances of points and the' if points else 'The'} two rows of "
        "`contacts.npy` and `joints.npy` are indices into the record's `parts`. `lineage.parents` names the sources of "
        "a sample.",
        "## Coordinates",
        f"Right-handed, y up; mesh, poses, bounds and contacts share one frame. {unit_sentence(tallies)} "
        f"{text.coordinates} The ground of a "
        "shape is the plane through its lowest point, `bounds[0][1]` in the record. A part's `pose` maps its own "
        "coordinates to those of the shape, and is the matrix of its node in the GLB. "
        + "".join(f"{sentence} " for sentence in text.members_coordinates)
        + "Vertex colours are linear, as in glTF.",
        "## Intended use and limitations",
        USES,
        "\n".join(f"- {limit}" for limit in (*LIMITS, *text.limits)),
        "## Loading",
        _loading(facts, splits, shards, names),
        "## How it was made",
        f"By Shapemill: {text.made} `{MANIFEST}` holds the whole config and the versions of code and libraries.",
        *([reject_table(text.rejects)] if text.rejects else []),
        *text.paragraphs,
        "## Verification",
        f"`sha256sum -c {CHECKSUMS}` checks every file. `python {VERIFIER}` needs numpy and trimesh only. It also "
        "checks every record, and the geometry of 100 samples. `make verify` of Shapemill checks "
        f"{_listed(['statics', *text.checks])}.",
        "## Licence and citation",
        f"{facts['license']}.",
        *(["Made from:", origin_table(text.origins)] if text.origins else []),
        *(["\n".join(f"- {sentence}" for sentence in text.missing_licenses)] if text.missing_licenses else []),
        f"```bibtex\n{citation(facts)}\n```",
    ]
    front = yaml.safe_dump(header, sort_keys=False, allow_unicode=True, width=1000)
    return f"---\n{front}---\n\n" + "\n\n".join(sections) + "\n"


def _listed(words: Sequence[str]) -> str:
    """Return words as a list in a sentence."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def unit_sentence(tallies: Mapping[str, SourceTally]) -> str:
    """Say in which unit the coordinates of each kit or program are."""
    metric = [name for name, tally in tallies.items() if tally.unit == "metre"]
    if len(metric) == len(tallies):
        return "The unit is the metre."
    if metric:
        return f"The unit is the metre for {', '.join(metric)}, and unknown for the others; each record states it."
    return "The unit is unknown (`unit` in each record)."


def _pictured(names: Sequence[str]) -> list[str]:
    """Return what the preview shows besides shapes and points."""
    has_views = bool(PICTURED & set(names)) or "view0.exr" in names
    return (["sketches"] if "sketch0.png" in names else []) + (["views"] if has_views else [])


def _loading(
    facts: Mapping[str, Any], splits: Sequence[str], shards: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> str:
    name, split = facts["name"], splits[0]
    count = sum(1 for shard in shards if shard["split"] == split)
    stem = str(shards[0]["path"]).rpartition("-")[0]
    pattern = f"{name}/{stem}-{{{0:06d}..{count - 1:06d}}}.tar"
    loaded = [member for member in LOADED if member in names]
    read = ", ".join([f'sample["{member}"]' for member in loaded] + ['sample["json"]["parts"]'])
    batch = ", ".join(f'"{member}"' for member in [*loaded, "contacts.npy"][:2] if member != "txt")
    pictures = PICTURES.format(next(name for name in names if name in PICTURED)) if set(names) & PICTURED else ""
    recorded = (loaded[0] if loaded else "glb").partition(".")[0]
    return f"""```python
# WebDataset, also below a torch DataLoader
import webdataset
samples = webdataset.WebDataset("{pattern}", shardshuffle=False).decode()
for sample in samples:
    {read}
{pictures}
# torch
from torch.utils.data import DataLoader
loader = DataLoader(samples.to_tuple({batch}).batched(16), batch_size=None, num_workers=4)

# Hugging Face
import datasets
samples = datasets.load_dataset("{name}", split="{split}")

# Croissant: each member is a record set of `key` and `content` (an array as the bytes of its .npy);
# `<member>-of-samples` has `split` and `kit` too; `samples` is the index
import mlcroissant
records = mlcroissant.Dataset("{name}/{CROISSANT}").records("{recorded}-of-samples")

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
