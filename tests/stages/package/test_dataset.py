"""The dataset folder: what it holds, that its bytes depend on the config alone, what happens to old files."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import tarfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import yaml

from pipeline.paths import DatasetPaths, file_digest
from pipeline.run import run_stage
from pipeline.shards import bytes_array, read_shard
from stages.shape.collection.pairs import pairs_of
from stages.shape.geometry.pose import invert, transform_points
from stages.verification.samples import empty_values
from tests.stages.package.toy import (
    REFUSED,
    SPLITS,
    TOY_STAGES,
    make_toy,
    toy_config,
    toy_keys,
    toy_kit,
    toy_samples,
)

MEMBERS = ["glb", "txt", "caption.json", "urdf.tar.gz", "mjcf.tar.gz", "usd.tar.gz", "obj.tar.gz"]
MEMBERS += ["points.npy", "normals.npy", "labels.npy", "instances.npy"]
MEMBERS += ["points1.npy", "normals1.npy", "labels1.npy", "instances1.npy", "scan_points0.npy", "scan_normals0.npy"]
MEMBERS += ["scan_labels0.npy", "scan_instances0.npy", "scan_cameras0.npy"]
MEMBERS += ["sketch0.png", "sketch1.png", "union_vertices.npy", "union_faces.npy", "union_instances.npy"]
MEMBERS += ["sdf_points.npy", "sdf_values.npy", "occupancy.npy", "contacts.npy", "joints.npy"]
MEMBERS += ["color0.png", "depth0.exr", "instances0.png", "json"]


def digests(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): file_digest(path) for path in sorted(folder.rglob("*")) if path.is_file()
    }


def all_samples(folder: Path) -> dict[str, dict[str, bytes]]:
    return {key: members for path in sorted(folder.rglob("*.tar")) for key, members in read_shard(path)}


def test_every_sample_that_no_stage_refused_is_there_with_the_same_members(toy_folder: Path) -> None:
    samples = all_samples(toy_folder)
    assert list(samples) == [key for split in sorted(SPLITS) for key in toy_keys(split)]
    assert all(list(members) == MEMBERS for members in samples.values())


def test_tar_entries_carry_neither_time_nor_user(toy_folder: Path) -> None:
    for path in toy_folder.rglob("*.tar"):
        with tarfile.open(path) as tar:
            for entry in tar:
                assert (entry.mtime, entry.uid, entry.gid, entry.uname, entry.gname, entry.mode) == (
                    *(0, 0, 0, "", ""),
                    0o644,
                )


def test_the_json_has_the_same_fields_in_every_sample_and_nothing_empty(toy_folder: Path) -> None:
    def shape(value: object) -> object:
        if isinstance(value, dict):
            return {name: shape(item) for name, item in value.items()}
        return [shape(value[0])] if isinstance(value, list) else type(value).__name__

    records = [json.loads(members["json"]) for members in all_samples(toy_folder).values()]
    assert all(shape(record) == shape(records[0]) for record in records)
    assert not [place for record in records for place in empty_values(record)]


def test_record_agrees_with_the_collection(toy_folder: Path) -> None:
    samples = all_samples(toy_folder)
    sample = toy_samples("val", 3, 2)[1]
    record = json.loads(samples[sample.key]["json"])
    assert (record["key"], record["split"], record["kit"], record["graph"]) == (
        *(sample.key, "val", sample.kit),
        sample.graph,
    )
    assert pairs_of(samples[sample.key]["contacts.npy"]).tolist() == sample.assembly.edges.tolist()
    first = {"blocks": 0, "planks": 2}[sample.kit]
    assert [part["class"] for part in record["parts"]] == (sample.assembly.types + first).tolist()
    assert [part["label"] for part in record["parts"]] == [("tower", "long.wall")[k] for k in sample.assembly.types]
    assert record["counts"] == {
        "parts": len(sample.assembly),
        "contacts": len(sample.assembly) - 1,
        "pieces": 1,
        "cycles": 0,
        "types": 2,
    }
    assert record["lineage"] == sample.lineage
    assert record["contact_tolerance"] == toy_kit(sample.kit).contact_tolerance
    assert record["points"] == {
        "farthest": 16,
        "uniform": 64,
        "surface": "all",
        "centre": [0, 0, 0],
        "scale": 1.0,
        "min_per_part": 4,
        "clouds": 2,
    }


def test_classes_are_listed_with_their_counts_by_split(toy_folder: Path) -> None:
    """Recounted from the records; ids are indices of the list, and colours those of the kits' types."""
    table = json.loads((toy_folder / "classes.json").read_text(encoding="utf-8"))
    assert [item["id"] for item in table] == list(range(4))
    assert [(item["name"], item["kit"]) for item in table] == [
        (name, kit) for kit in ("blocks", "planks") for name in ("tower", "long.wall")
    ]
    assert [item["color"] for item in table] == ["#c82828", "#2828c8"] * 2
    shapes, parts = Counter[tuple[int, str]](), Counter[tuple[int, str]]()
    for members in all_samples(toy_folder).values():
        record = json.loads(members["json"])
        own = [part["class"] for part in record["parts"]]
        assert all(table[number]["kit"] == record["kit"] for number in own)
        assert [table[number]["name"] for number in own] == [part["label"] for part in record["parts"]]
        shapes.update((number, record["split"]) for number in set(own))
        parts.update((number, record["split"]) for number in own)
        assert set(bytes_array(members["labels.npy"]).tolist()) <= set(own)
    for item in table:
        assert item["shapes"] == {split: shapes[item["id"], split] for split in SPLITS}
        assert item["parts"] == {split: parts[item["id"], split] for split in SPLITS}
    named = json.loads((toy_folder / "manifest.json").read_text(encoding="utf-8"))["classes"]
    assert named == {"path": "classes.json", "count": 4, "sha256": file_digest(toy_folder / "classes.json")}


def test_mesh_points_poses_and_bounds_share_upright_coordinates(toy_folder: Path) -> None:
    """Of a kit whose z points up the boxes' height lies along y, in the mesh, the points and the JSON alike."""
    import trimesh

    checked = set()
    for members in all_samples(toy_folder).values():
        record = json.loads(members["json"])
        scene = trimesh.load(io.BytesIO(members["glb"]), file_type="glb", process=False)
        points, instances = bytes_array(members["points.npy"]), bytes_array(members["instances.npy"])
        assert np.allclose(scene.bounds, record["bounds"], atol=1e-6)
        boxes = [part_type.bounds for part_type in toy_kit(record["kit"]).types]
        up = {"blocks": 1, "planks": 2}[record["kit"]]
        heights = [boxes[("tower", "long.wall").index(part["label"])][1, up] for part in record["parts"]]
        assert np.allclose(np.asarray(record["bounds"])[1, 1], max(heights))
        for part in record["parts"]:
            pose = np.array(part["pose"])
            assert np.array_equal(scene.graph.get(part["name"])[0], pose)
            own = transform_points(invert(pose), points[instances == part["instance"]].astype(float))
            low, high = boxes[("tower", "long.wall").index(part["label"])]
            outside = np.maximum(low - own, own - high).max(axis=1)
            assert np.abs(outside).max(initial=0.0) < 1e-6
        checked.add(record["kit"])
    assert checked == {"blocks", "planks"}


def test_camera_of_a_record_projects_the_mesh_onto_the_ink(toy_folder: Path) -> None:
    import PIL.Image
    import trimesh

    for members in all_samples(toy_folder).values():
        vertices = trimesh.load(io.BytesIO(members["glb"]), file_type="glb", process=False).to_mesh().vertices
        for index, camera in enumerate(json.loads(members["json"])["sketches"]):
            turned = np.array(camera["world_to_camera"]) @ np.column_stack([vertices, np.ones(len(vertices))]).T
            across, down, _ = np.array(camera["intrinsics"]) @ (turned[:3] / turned[2])
            ink = np.nonzero(np.asarray(PIL.Image.open(io.BytesIO(members[f"sketch{index}.png"]))) < 128)
            for seen, inked in zip((down, across), ink, strict=True):
                assert abs(seen.min() - (inked.min() + 0.5)) < 1.0
                assert abs(seen.max() - (inked.max() + 0.5)) < 1.0


def test_a_row_of_the_index_leads_to_its_sample(toy_folder: Path) -> None:
    rows = pyarrow.parquet.read_table(toy_folder.parent / "toy-index" / "toy.parquet").to_pylist()
    samples = all_samples(toy_folder)
    assert [row["key"] for row in rows] != []
    assert {row["key"] for row in rows} == set(samples)
    for row in rows:
        with open(toy_folder / row["shard"], "rb") as shard:
            shard.seek(row["offset"])
            piece = io.BytesIO(shard.read(row["bytes"]))
        with tarfile.open(fileobj=piece) as tar:
            found = {name: tar.extractfile(name).read() for name in tar.getnames()}
        assert found == {f"{row['key']}.{member}": content for member, content in samples[row["key"]].items()}
        record = json.loads(samples[row["key"]]["json"])
        assert {name: row[name] for name in record["counts"]} == record["counts"]
        assert row["text"] == record["text"]


def test_card_has_the_metadata_of_hugging_face(toy_folder: Path) -> None:
    _, front, text = (toy_folder / "README.md").read_text(encoding="utf-8").split("---\n", 2)
    header = yaml.safe_load(front)
    assert header["license"] == "mit"
    assert header["pretty_name"] == "Toy boxes"
    assert header["size_categories"] == ["n<1K"]
    assert {"task_categories", "tags"} <= set(header)
    (only,) = header["configs"]
    assert only["config_name"] == "default"
    assert {item["split"]: item["path"] for item in only["data_files"]} == {
        split: f"data/{split}/*.tar" for split in SPLITS
    }
    assert "](preview.png)" in text
    assert "| total | 23 | 12 |" in text


def test_checksums_cover_every_file_and_the_manifest_the_index(toy_folder: Path) -> None:
    listed = dict(
        line.split("  ")[::-1] for line in (toy_folder / "checksums.txt").read_text(encoding="utf-8").splitlines()
    )
    there = digests(toy_folder)
    del there["checksums.txt"]
    assert listed == there
    index = json.loads((toy_folder / "manifest.json").read_text(encoding="utf-8"))["index"]
    assert hashlib.sha256((toy_folder / index["path"]).read_bytes()).hexdigest() == index["sha256"]


@pytest.mark.slow
def test_folder_does_not_depend_on_location_or_number_of_workers(toy_folder: Path, tmp_path: Path) -> None:
    again = make_toy(tmp_path / "elsewhere", toy_config(), workers=2)
    assert digests(again) == digests(toy_folder)
    assert digests(again.parent / "toy-index") == digests(toy_folder.parent / "toy-index")


def test_smaller_config_removes_its_old_shards_and_nothing_else(toy_folder: Path, tmp_path: Path) -> None:
    shutil.copytree(toy_folder.parent, tmp_path / "out")
    (tmp_path / "out/toy/notes.txt").write_text("mine", encoding="utf-8")
    folder = make_toy(tmp_path / "out", toy_config(shards=1))
    assert [path.name for path in sorted(folder.rglob("*.tar"))] == [
        f"toy-1_2_0-{split}-000000.tar" for split in sorted(SPLITS)
    ]
    assert (folder / "notes.txt").read_text(encoding="utf-8") == "mine"


def test_sample_refused_by_a_stage_is_left_out_and_counted(toy_folder: Path) -> None:
    assert REFUSED not in all_samples(toy_folder)
    manifest = json.loads((toy_folder / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["samples"] == 23
    assert manifest["splits"] == {"train": 7, "val": 8, "test": 8}
    (line,) = (
        (toy_folder.parent / ".work/toy/package/rejects/toy-train-000001.jsonl")
        .read_text(encoding="utf-8")
        .splitlines()
    )
    assert json.loads(line) == {"item": REFUSED, "reason": "refused by sketches", "detail": "", "count": 1}


def test_new_title_rebuilds_card_and_picture_and_no_shard(toy_folder: Path, tmp_path: Path) -> None:
    shutil.copytree(toy_folder.parent, tmp_path / "out")
    config = replace(toy_config(), title="Other")
    result = run_stage("package", TOY_STAGES, config, DatasetPaths(tmp_path / "out", "toy"), 1)
    assert result.made == 2
    before, after = digests(toy_folder), digests(tmp_path / "out/toy")
    changed = {file for file in after if after[file] != before[file]}
    assert changed == {"README.md", "croissant.json", "preview.png", "checksums.txt", "manifest.json"}


@pytest.mark.parametrize(
    ("value", "places"),
    [
        ({"a": 0, "b": False, "c": 0.0}, []),
        ({"a": None}, ["a"]),
        ({"a": [{"b": ""}, {"b": "x"}]}, ["a[0].b"]),
        ({"a": [], "b": {}}, ["a", "b"]),
        ({"a": [[1.0], []]}, ["a[1]"]),
    ],
)
def test_empty_values_are_located(value: object, places: list[str]) -> None:
    assert list(empty_values(value)) == places
