"""The dataset folder in the loaders that users have, with no glue. Nothing here touches the network."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.stages.package.toy import SPLITS, toy_keys

POINTS = 16 + 64


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
    return f"{folder}/data/{split}/toy-1_2_0-{split}-{{000000..000007}}.tar"


@pytest.mark.parametrize("split", SPLITS)
def test_webdataset_yields_each_sample_once_and_decoded(toy_folder: Path, split: str) -> None:
    import webdataset

    samples = list(webdataset.WebDataset(shard_pattern(toy_folder, split), shardshuffle=False).decode())
    assert [sample["__key__"] for sample in samples] == toy_keys(split)
    for sample in samples:
        assert sample["points.npy"].shape == sample["normals.npy"].shape == (POINTS, 3)
        assert sample["points.npy"].dtype == np.float32
        assert sample["labels.npy"].dtype == sample["instances.npy"].dtype == np.int16
        assert sample["json"]["key"] == sample["__key__"]
        assert sample["txt"].split()[0] == sample["json"]["text"]


@pytest.mark.filterwarnings("ignore:This DataLoader will create")
def test_a_torch_loader_of_four_workers_yields_each_sample_once(toy_folder: Path) -> None:
    import webdataset
    from torch.utils.data import DataLoader

    samples = webdataset.WebDataset(shard_pattern(toy_folder, "train"), shardshuffle=False).decode()
    tuples = samples.to_tuple("__key__", "points.npy", "labels.npy").batched(2)
    seen = []
    for names, points, labels in DataLoader(tuples, batch_size=None, num_workers=4):
        assert tuple(points.shape) == (len(names), POINTS, 3)
        assert tuple(labels.shape) == (len(names), POINTS)
        seen.extend(names)
    assert sorted(seen) == sorted(toy_keys("train"))


HUGGING_FACE = """
import json, sys
import datasets
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
    "points": [len(each["points.npy"]) for each in loaded["val"]],
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
    assert features["txt"] == "Value('string')"
    assert "null" not in features["json"]
    assert found["nodes"] == sorted(found["parts"])
    assert found["size"] == [24, 24]
    assert set(found["points"]) == {POINTS}


CROISSANT = """
import json, logging, sys
logging.basicConfig(stream=sys.stdout, level=logging.WARNING)
import mlcroissant
dataset = mlcroissant.Dataset(sys.argv[1])
issues = dataset.metadata.ctx.issues
found = {"issues": sorted(map(str, [*issues.errors, *issues.warnings])), "records": {}, "lengths": {}}
for record_set in dataset.metadata.record_sets:
    name = record_set.uuid
    if name == "classes":
        continue
    records = list(dataset.records(name))
    found["records"][name] = [record[f"{name}/key"].decode() for record in records]
    contents = [record[f"{name}/content"] for record in records]
    found["lengths"][name] = [len(each) if isinstance(each, bytes) else list(each.size) for each in contents]
found["classes"] = [
    [row["classes/id"], *(row[f"classes/{name}"].decode() for name in ("name", "kit", "color"))]
    for row in dataset.records("classes")
]
found["version"] = str(dataset.metadata.ctx.conforms_to)
print(json.dumps(found))
"""


def test_mlcroissant_validates_without_error_or_warning_and_yields_every_member(
    toy_folder: Path, tmp_path: Path
) -> None:
    from pipeline.shards import read_shard

    (line,) = outside(CROISSANT, str(toy_folder / "croissant.json"), cache=tmp_path).splitlines()
    found = json.loads(line)
    assert found["issues"] == []
    assert found["version"].endswith("V_1_1")
    listed = json.loads((toy_folder / "classes.json").read_text())
    assert found["classes"] == [[each[name] for name in ("id", "name", "kit", "color")] for each in listed]
    stored = {key: members for path in toy_folder.rglob("*.tar") for key, members in read_shard(path)}
    members = {member.partition(".")[0]: member for member in next(iter(stored.values()))}
    assert set(found["records"]) == set(members)
    for name, member in members.items():
        assert sorted(found["records"][name]) == sorted(stored)
        for key, length in zip(found["records"][name], found["lengths"][name], strict=True):
            assert length == ([24, 24] if member.endswith(".png") else len(stored[key][member]))
