"""`README.md`: the dataset's card, with the metadata that Hugging Face reads and the text that people read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from stages.package.layout import CHECKSUMS, CROISSANT, MANIFEST, PREVIEW, SCHEMA
from stages.package.sources import SourceTally
from stages.package.tables import class_table, member_table, origin_table, reject_table, source_table, split_table

SIZE_CATEGORIES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))

USES = (
    "For training and measuring models that generate, complete, segment or reconstruct shapes made of parts, and for "
    "work on shape grammars, shape programs and physical validity. Not for conclusions about how real things look or "
    "are built, nor for deciding whether a real thing is safe."
)
LIMITS = (
    "The shapes are synthetic. They are not a sample of real things, and no person has judged them.",
    "Whether a shape stands is computed by statics with one density everywhere. Nothing was simulated or built.",
    "Meshes have one colour a face at most, and no textures, materials or normals.",
    "Points lie on the whole surface of every part, also where it is hidden inside another part: no scanner sees that.",
)


@dataclass(frozen=True)
class Story:
    """How a dataset was made, in the words of its producer and its language.

    made: how its samples come about; splits: paragraphs on what keeps the splits apart; coordinates: their units and
    their origin;
    limits: what not to expect; paragraphs, variety: Markdown; rejects: refused items by reason; origins: what it was
    made from, and whose that is; unstated: a sentence for each of these without a licence.
    """

    made: str
    splits: Sequence[str]
    coordinates: str
    limits: Sequence[str]
    paragraphs: Sequence[str]
    variety: Sequence[str]
    rejects: Mapping[str, int]
    origins: Sequence[Mapping[str, Any]]
    missing_licenses: Sequence[str]


def citation(facts: Mapping[str, Any]) -> str:
    """How to cite the dataset, as BibTeX on one line."""
    year = str(facts["published"])[:4]
    return (
        f"@misc{{{facts['name']}, title={{{facts['title']}}}, author={{{facts['creator']}}}, year={{{year}}}, "
        f"version={{{facts['version']}}}}}"
    )


def size_category(samples: int) -> str:
    """Hugging Face's name for a dataset of this size."""
    return next((name for limit, name in SIZE_CATEGORIES if samples < limit), "n>1M")


def card(
    facts: Mapping[str, Any],
    shards: Sequence[Mapping[str, Any]],
    members: Sequence[Mapping[str, Any]],
    tallies: Mapping[str, SourceTally],
    sources: Mapping[str, str],
    classes: Sequence[Mapping[str, Any]],
    story: Story,
) -> str:
    """The card's text.

    facts: name, version, title, description, license, creator, published, tags, task_categories; shards: summaries
    of the package's shards; members: name, sentence, dtype and shape of each; tallies: what the index
    says of each kit; sources: the kits or programs by name, with what there is to say of them in short; classes: the
    rows of `classes.json`.
    """
    splits = list(dict.fromkeys(str(shard["split"]) for shard in shards))
    header = {
        "license": str(facts["license"]).lower(),
        "pretty_name": facts["title"],
        "task_categories": list(facts["task_categories"]),
        "size_categories": [size_category(sum(each.samples for each in tallies.values()))],
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
        split_table(splits, shards),
        source_table(sources, tallies),
        "## How the splits are kept apart",
        *story.splits,
        "## Part labels",
        class_table(classes, splits),
        *(["## How different they are", *story.variety] if story.variety else []),
        "## A sample",
        member_table(members),
        f"`{SCHEMA}` says what each field of the JSON means. No key holds a dot, no value is null or empty, and each "
        "sample has all members and all fields. A part is named by its place in the record's `parts`: instances of "
        "points, and the two rows of `contacts.npy` and `joints.npy`, are such places. `lineage.parents` says what a "
        "sample was made from.",
        "## Coordinates",
        f"Right-handed, y up; mesh, poses, bounds and contacts have one frame. {story.coordinates} The ground of a "
        "shape is the plane through its lowest point, `bounds[0][1]` in the record. A part's `pose` moves its mesh "
        "from the part's own coordinates into those of the shape, and is the matrix of its node in the GLB. The points "
        "are in the coordinates of the mesh, or moved and scaled as `points.centre` and `points.scale` say. Vertex "
        "colours are linear, as glTF asks.",
        "## What it is for, and what not",
        USES,
        "\n".join(f"- {each}" for each in (*LIMITS, *story.limits)),
        "## Loading it",
        _loading(facts, splits, shards),
        "## How it was made",
        f"By Shapemill: {story.made} `{MANIFEST}` holds the whole config and the versions of code and libraries.",
        *([reject_table(story.rejects)] if story.rejects else []),
        *story.paragraphs,
        "## Checking it",
        f"`sha256sum -c {CHECKSUMS}` compares every file; `make verify` also holds every sample against what it "
        "says of itself, and computes contacts anew from meshes.",
        "## Licence and citation",
        f"{facts['license']}.",
        *(["What it was made from, and whose that is:", origin_table(story.origins)] if story.origins else []),
        *(["\n".join(f"- {each}" for each in story.missing_licenses)] if story.missing_licenses else []),
        f"```bibtex\n{citation(facts)}\n```",
    ]
    front = yaml.safe_dump(header, sort_keys=False, allow_unicode=True, width=1000)
    return f"---\n{front}---\n\n" + "\n\n".join(sections) + "\n"


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

# Croissant: each member is a record set of `key` and `content`, an array being the bytes of its .npy;
# with "-of-samples" behind its name it has `split` and `kit` too; `samples` is the index
import mlcroissant
records = mlcroissant.Dataset("{name}/{CROISSANT}").records("points-of-samples")

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
