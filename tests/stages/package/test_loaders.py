"""The dataset folder in the loaders that users have, with no glue. Nothing here touches the network."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest

from pipeline.shards import bytes_array, read_shard
from tests.stages.package.toy import SPLITS, toy_keys

POINT_COUNT = 16 + 64


def outside(script: str, *arguments: str, cache: Path) -> str:
    """What a Python of its own prints: the loaders read their caches' places when they are imported."""
    environment = {
        **os.environ,
        "HF_HUB_OFFLINE": "1",
        "HF_DATASETS_OFFLINE": "1",
        "HF_HOME": str(cache / "hugging-face"),
        "CROISSANT_CACHE": str(cache / "croissant"),
    }
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], env=environment, cwd=cache, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def shard_pattern(folder: Path, split: str) -> str:
    return f"{folder}/data/{split}/toy-1_2_0-{split}-{{000000..000003}}.tar"


@pytest.mark.parametrize("split", SPLITS)
def test_webdataset_yields_every_sample_once_and_decoded(toy_folder: Path, split: str) -> None:
    import webdataset

    samples = list(webdataset.WebDataset(shard_pattern(toy_folder, split), shardshuffle=False).decode())
    assert [sample["__key__"] for sample in samples] == toy_keys(split)
    for sample in samples:
        assert sample["points.npy"].shape == sample["normals.npy"].shape == (POINT_COUNT, 3)
        assert sample["points.npy"].dtype == np.float32
        assert sample["labels.npy"].dtype == sample["instances.npy"].dtype == np.int16
        assert sample["contacts.npy"].shape == (2, sample["json"]["counts"]["contacts"])
        assert sample["json"]["key"] == sample["__key__"]
        assert sample["txt"].split()[0] == sample["json"]["text"]


@pytest.mark.filterwarnings("ignore:This DataLoader will create")
def test_a_torch_loader_of_four_workers_yields_every_sample_once(toy_folder: Path) -> None:
    import webdataset
    from torch.utils.data import DataLoader

    samples = webdataset.WebDataset(shard_pattern(toy_folder, "train"), shardshuffle=False).decode()
    tuples = samples.to_tuple("__key__", "points.npy", "labels.npy").batched(2)
    seen = []
    for names, points, labels in DataLoader(tuples, batch_size=None, num_workers=4):
        assert tuple(points.shape) == (len(names), POINT_COUNT, 3)
        assert tuple(labels.shape) == (len(names), POINT_COUNT)
        seen.extend(names)
    assert sorted(seen) == sorted(toy_keys("train"))


HUGGING_FACE = """
import json, sys
import datasets, numpy
loaded = datasets.load_dataset(sys.argv[1], cache_dir=sys.argv[2])
streamed = datasets.load_dataset(sys.argv[1], streaming=True, cache_dir=sys.argv[2])
features = {name: str(kind) for name, kind in loaded["train"].features.items()}
first = loaded["test"][0]
print(json.dumps({
    "keys": {split: list(loaded[split]["__key__"]) for split in loaded},
    "streamed": {split: [sample["__key__"] for sample in streamed[split]] for split in streamed},
    "features": features,
    "nodes": sorted(first["glb"].graph.nodes_geometry),
    "parts": [part["name"] for part in first["json"]["parts"]],
    "size": first["sketch0.png"].size,
    "color": first["color0.png"].size,
    "ids": str(numpy.asarray(first["instances0.png"]).dtype),
    "shown": sorted(set(numpy.asarray(first["instances0.png"]).ravel().tolist())),
    "points": [len(each["points.npy"]) for each in loaded["val"]],
    "contacts": {
        each["__key__"]: numpy.asarray(each["contacts.npy"]).tolist()
        for kind in (loaded, streamed)
        for split in kind
        for each in kind[split]
    },
    "types": str(streamed["train"].features["contacts.npy"]),
}))
"""


def test_hugging_face_datasets_loads_every_split_with_typed_members(toy_folder: Path, tmp_path: Path) -> None:
    found = json.loads(outside(HUGGING_FACE, str(toy_folder), str(tmp_path / "cache"), cache=tmp_path))
    assert found["keys"] == found["streamed"] == {split: toy_keys(split) for split in SPLITS}
    features = found["features"]
    assert features["glb"].startswith("Mesh")
    assert features["sketch0.png"].startswith("Image")
    assert features["points.npy"] == features["normals.npy"] == "List(List(Value('float32')))"
    assert features["labels.npy"] == features["instances.npy"] == "List(Value('int16'))"
    assert features["contacts.npy"] == found["types"] == "List(List(Value('int32')))"
    stored = {key: members for path in toy_folder.rglob("*.tar") for key, members in read_shard(path)}
    assert found["contacts"] == {key: bytes_array(item["contacts.npy"]).tolist() for key, item in stored.items()}
    assert [[], []] in found["contacts"].values()
    assert features["txt"] == "Value('string')"
    assert "null" not in features["json"]
    assert found["nodes"] == sorted(found["parts"])
    assert found["size"] == [24, 24]
    assert found["color"] == [32, 24]
    assert found["ids"] == "uint16"
    assert set(found["shown"]) <= set(range(len(found["parts"]) + 1))
    assert set(found["points"]) == {POINT_COUNT}


CROISSANT = """
import json, logging, sys
logging.basicConfig(stream=sys.stdout, level=logging.WARNING)
import mlcroissant
dataset, joined = (mlcroissant.Dataset(sys.argv[1]) for _ in range(2))
issues = dataset.metadata.ctx.issues
found = {"issues": sorted(map(str, [*issues.errors, *issues.warnings])), "records": {}, "shapes": {}}
def plain(value):
    if isinstance(value, bytes):
        return value.decode() if len(value) < 60 and value.isascii() else len(value)
    return list(value.size) if hasattr(value, "mode") else value
for record_set in dataset.metadata.record_sets:
    name = record_set.uuid
    # what a Dataset has read cannot be joined any more, and parsing the document takes longer than reading the records
    records = (joined if name.endswith("-of-samples") else dataset).records(name)
    found["records"][name] = [{each.rpartition("/")[2]: plain(record[each]) for each in record} for record in records]
    found["shapes"] |= {f.uuid: [f.array_shape_tuple, f.data_types] for f in record_set.fields if f.is_array}
found["version"] = str(dataset.metadata.ctx.conforms_to)
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def croissant(toy_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What mlcroissant says of the toy dataset: issues, records of every record set, shapes of arrays."""
    cache = tmp_path_factory.mktemp("croissant")
    (line,) = outside(CROISSANT, str(toy_folder / "croissant.json"), cache=cache).splitlines()
    found: dict[str, Any] = json.loads(line)
    return found


def test_mlcroissant_validates_without_error_or_warning_and_yields_every_member(
    toy_folder: Path, croissant: dict[str, Any]
) -> None:
    assert croissant["issues"] == []
    assert croissant["version"].endswith("V_1_1")
    listed = json.loads((toy_folder / "classes.json").read_text(encoding="utf-8"))
    known = [{name: item[name] for name in ("id", "name", "kit", "color")} for item in listed]
    assert croissant["records"]["classes"] == known
    stored = {key: members for path in toy_folder.rglob("*.tar") for key, members in read_shard(path)}
    members = {member.partition(".")[0]: member for member in next(iter(stored.values()))}
    assert set(croissant["records"]) == {
        "splits",
        "samples",
        "classes",
        *members,
        *(f"{name}-of-samples" for name in members),
    }
    for name, member in members.items():
        records = {item["key"]: item["content"] for item in croissant["records"][name]}
        assert set(records) == set(stored)
        for key, content in records.items():
            size = len(stored[key][member])
            assert content in ([24, 24], [32, 24], size, stored[key][member].decode("latin-1"))


def test_mlcroissant_knows_splits_types_and_shapes(toy_folder: Path, croissant: dict[str, Any]) -> None:
    records = croissant["records"]
    assert {record["name"] for record in records["splits"]} == set(SPLITS)
    split_of = {key: split for split in SPLITS for key in toy_keys(split)}
    assert {record["key"]: record["split"] for record in records["samples"]} == split_of
    rows = pyarrow.parquet.read_table(toy_folder.parent / "toy-index" / "toy.parquet").to_pylist()
    assert {record["key"]: record["rooted"] for record in records["samples"]} == {
        row["key"]: row["rooted"] for row in rows
    }
    for joined in ("points-of-samples", "sketch0-of-samples", "json-of-samples"):
        assert {record["key"]: record["split"] for record in records[joined]} == split_of
    shape, (text, element) = croissant["shapes"]["points/content"]
    assert (shape, text.rpartition("/")[2], element.rpartition("/")[2]) == ([POINT_COUNT, 3], "Text", "Float32")
    assert croissant["shapes"]["contacts-of-samples/content"][0] == [2, -1]
