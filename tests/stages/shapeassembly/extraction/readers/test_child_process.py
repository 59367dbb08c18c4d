"""A hierarchy comes out of the process that has read it as it was, and whatever ends that process is one refusal."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import Rejected
from stages.shapeassembly.extraction.hierarchy import UNREADABLE, Box, PartHierarchy, PartNode
from stages.shapeassembly.extraction.readers.child_process import read_grass_in_child, read_in_child
from stages.shapeassembly.extraction.readers.grass import read_grass

RNG = np.random.default_rng(0)


def part(label: str, *children: PartNode) -> PartNode:
    return PartNode(
        label, Box(RNG.normal(size=3), RNG.random(3) / 3, np.linalg.qr(RNG.normal(size=(3, 3)))[0]), children
    )


def flat(root: PartNode) -> list[float | str]:
    numbers = [*root.box.center.tolist(), *root.box.size.tolist(), *root.box.axes.ravel().tolist()]
    return [root.label, *numbers, len(root.children), *(item for child in root.children for item in flat(child))]


def test_hierarchy_survives_the_child_process_exactly() -> None:
    whole = PartHierarchy("stuhl ä", part("root", part("seat"), part("back", part("slat"), part("slat"))))
    found = read_in_child(lambda _: whole, Path("chair.json"))
    assert found.name == whole.name
    assert flat(found.root) == flat(whole.root)


def test_rejection_keeps_reason_and_detail() -> None:
    def read(path: Path) -> PartHierarchy:
        raise Rejected("some reason", f"{path.name}: no `label`")

    with pytest.raises(Rejected) as caught:
        read_in_child(read, Path("folder/chair.json"))
    assert (caught.value.reason, caught.value.detail) == ("some reason", "chair.json: no `label`")


def test_crash_of_a_reader_is_a_rejection_that_names_the_file() -> None:
    def read(_: Path) -> PartHierarchy:
        ctypes.string_at(0)
        raise AssertionError

    with pytest.raises(Rejected, match=r"chair\.glb: cannot be read: a native library crashed on it") as caught:
        read_in_child(read, Path("chair.glb"))
    assert caught.value.reason == UNREADABLE


def test_grass_shapes_survive_the_child_process(tmp_path: Path) -> None:
    path = tmp_path / "chairs.npz"
    np.savez(path, full_boxes=RNG.normal(size=(5, 12)), full_offsets=np.array([0, 2, 5]))
    here, there = read_grass(path), read_grass_in_child(path)
    assert here.name == there.name
    np.testing.assert_array_equal(here.boxes, there.boxes)
    np.testing.assert_array_equal(here.offsets, there.offsets)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(Rejected, match="not a whole GRASS file"):
        read_grass_in_child(path)
