from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from pipeline.errors import Rejected
from stages.shapeassembly.extraction.hierarchy import PartHierarchy
from stages.shapeassembly.extraction.readers.source import HierarchySource

BOX = [0.0, 0.0, 0.0, 2.0, 1.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]


def folder(path: Path) -> Path:
    for name in ("b/2.json", "a/1.json", "c/3.json"):
        file = path / name
        file.parent.mkdir(parents=True)
        file.write_text(json.dumps({"label": name[2], "box": BOX}), encoding="utf-8")
    (path / "b" / "readme.txt").write_text("no hierarchy", encoding="utf-8")
    return path


def test_folder_is_read_in_the_order_of_its_names_and_by_slices(tmp_path: Path) -> None:
    source = HierarchySource(folder(tmp_path), "structurenet", "y")
    assert len(source) == 3
    found = list(source.read(1, 3))
    assert [name for name, _ in found] == ["b/2.json", "c/3.json"]
    assert [item.root.label for _, item in found if isinstance(item, PartHierarchy)] == ["2", "3"]


def test_unreadable_file_is_one_rejection_among_the_others(tmp_path: Path) -> None:
    source = HierarchySource(folder(tmp_path), "structurenet", "y")
    (tmp_path / "b" / "2.json").write_text("{", encoding="utf-8")
    assert [isinstance(item, Rejected) for _, item in source.read(0, 3)] == [False, True, False]


def test_digest_depends_on_names_and_bytes_of_its_slice(tmp_path: Path) -> None:
    source = HierarchySource(folder(tmp_path), "structurenet", "y")
    first, rest = source.digest(0, 1), source.digest(1, 3)
    (tmp_path / "c" / "3.json").write_text(json.dumps({"label": "changed", "box": BOX}), encoding="utf-8")
    assert source.digest(0, 1) == first
    assert source.digest(1, 3) != rest
    (tmp_path / "a" / "1.json").rename(tmp_path / "a" / "0.json")
    assert source.digest(0, 1) != first


def test_partnet_digest_sees_the_meshes(tmp_path: Path) -> None:
    (tmp_path / "7" / "objs").mkdir(parents=True)
    (tmp_path / "7" / "result_after_merging.json").write_text("[]", encoding="utf-8")
    mesh = tmp_path / "7" / "objs" / "original-0.obj"
    mesh.write_text("v 0 0 0\n", encoding="utf-8")
    source = HierarchySource(tmp_path, "partnet", "y")
    before = source.digest(0, 1)
    mesh.write_text("v 0 0 1\nv 0 1 0\n", encoding="utf-8")
    assert source.digest(0, 1) != before


def test_shapes_of_one_npz_file_are_counted_and_named_by_place(tmp_path: Path) -> None:
    rows = np.tile(np.array(BOX), (3, 1))
    np.savez(tmp_path / "chairs.npz", full_boxes=rows, full_offsets=np.array([0, 1, 3]))
    source = HierarchySource(tmp_path / "chairs.npz", "grass", "y")
    assert len(source) == 2
    assert [name for name, _ in source.read(0, 2)] == ["chairs.npz/00000", "chairs.npz/00001"]


def test_unreadable_npz_file_is_one_rejection(tmp_path: Path) -> None:
    (tmp_path / "chairs.npz").write_bytes(b"no zip")
    source = HierarchySource(tmp_path / "chairs.npz", "grass", "y")
    assert len(source) == 1
    ((_, refused),) = source.read(0, 1)
    assert isinstance(refused, Rejected)
    assert source.digest(0, 1)
