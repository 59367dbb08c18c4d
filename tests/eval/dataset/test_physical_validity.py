"""The table of physical validity, of given shapes and from the command line."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from eval.dataset.physical_validity import PUBLISHED, judge_by_name, physical_table
from eval.engine.shapes import box_shape, shared_meshes
from eval.engine.table import Table
from stages.shape.arrays import FloatArray
from stages.shape.physics.boxes import box_corners
from stages.shape.physics.settings import PhysicsConfig
from tests.command import shapemill
from tests.stages.shape.geometry.bodies import box
from tests.stages.shape.physics.structures import solid

STABLE = solid(box(), box(at=(0, 0, 1)))
FLOATING = solid(box(), box(at=(0, 0, 3)))


def corners(*heights: float) -> FloatArray:
    """Unit boxes at these heights, y up."""
    count = len(heights)
    centres = np.array([[0, height, 0] for height in heights], dtype=float)
    return box_corners(centres, np.tile(np.eye(3), (count, 1, 1)), np.full((count, 3), 0.5))


def test_number_of_shapes_judged_as_dry_blocks_is_limited() -> None:
    shapes = [("towers", STABLE), ("towers", FLOATING), ("towers", FLOATING)]
    for dry_shapes, share in ((9, pytest.approx(100 / 3)), (1, 100), (2, 50), (0, "")):
        table = physical_table(judge_by_name(shapes, PhysicsConfig()), PhysicsConfig(), dry_shapes)
        found = dict(zip(table.columns, table.rows[0], strict=True))
        assert found["stable %"] == pytest.approx(100 / 3)
        assert found["dry stable %"] == share


def test_table_has_a_row_per_name_with_its_shares() -> None:
    post = solid(box(0.1, 0.1, 2, at=(0, 0, 1)))  # tips at a push of a twentieth of its weight
    results = judge_by_name([("b", STABLE), ("a", FLOATING), ("b", FLOATING), ("c", post)], PhysicsConfig())
    table = physical_table(results, PhysicsConfig(), 9, PUBLISHED[:1])
    rows = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    assert list(rows) == ["b", "a", "c"]
    assert (rows["b"]["shapes"], rows["b"]["parts"]) == (2, 2)
    assert (rows["b"]["rooted %"], rows["b"]["stable %"], rows["b"]["dry stable %"]) == (50, 50, 50)
    assert [(rows[name]["stable %"], rows[name]["dropped %"]) for name in "bc"] == [(50, 50), (100, 0)]
    assert (rows["a"]["floating"], rows["a"]["pieces"]) == (1, 2)
    ((_, ours),) = table.references_by_source().items()
    published = dict(zip(table.columns, ours[0], strict=True))
    assert published["shapes of"] == "chair, ground truth"
    assert (published["rooted %"], published["dropped %"]) == (100.0, 88.0)


def test_table_has_same_content_in_every_format() -> None:
    table = Table("T", ("name", "share %"), (("a_b|c", 12.345), ("d", 7)))
    assert "| a_b\\|c | 12.3 |\n| d | 7 |" in table.markdown()
    assert list(csv.reader(io.StringIO(table.csv()))) == [["name", "share %"], ["a_b|c", "12.345"], ["d", "7"]]
    assert "name & share \\% \\\\" in table.latex()
    assert "a\\_b|c & 12.3 \\\\" in table.latex()


def test_shared_meshes_are_distinct() -> None:
    first, second = shared_meshes([STABLE, FLOATING])
    assert len(first.meshes) == 3, "the lower box is the same"
    assert first.meshes is second.meshes
    for before, after in ((STABLE, first), (FLOATING, second)):
        for old, new in zip(before.assembly.types, after.assembly.types, strict=True):
            np.testing.assert_array_equal(before.meshes[old].vertices, after.meshes[new].vertices)


def test_box_shape_keeps_corners_and_drops_flat_boxes() -> None:
    flat = corners(0.5)
    flat[:, :, 0] = 0
    given = np.concatenate([corners(0.5, 1.5), flat])
    shape = box_shape(given, "y")
    assert len(shape) == 2
    for part in range(2):
        pose = shape.assembly.poses[part]
        points = shape.meshes[shape.assembly.types[part]].vertices @ pose[:3, :3].T + pose[:3, 3]
        np.testing.assert_allclose(np.sort(points, axis=0), np.sort(given[part], axis=0))


def test_physical_table_of_files(tmp_path: Path) -> None:
    stored = corners(0.5, 1.5, 0.5, 3.5)
    np.savez(tmp_path / "chair_boxes.npz", part_corners=stored, part_offsets=np.array([0, 2, 4]))
    code, printed = shapemill("eval", "physical", str(tmp_path / "chair_boxes.npz"))
    assert code == 0
    assert "| chair_boxes | 2 | 2 | 50.0 | 50.0 | 50.0 |" in printed
    assert "chair, ground truth (shapeassembly Table 2, by simulation)" in printed
    assert "storage" not in printed


def test_missing_dataset_and_wrong_file_are_reported(tmp_path: Path) -> None:
    code, printed = shapemill("eval", "physical", "--out", str(tmp_path))
    assert code == 2
    assert "make dataset" in printed
    np.savez(tmp_path / "other.npz", corners=np.zeros(3))
    code, printed = shapemill("eval", "physical", str(tmp_path / "other.npz"))
    assert code == 2
    assert "part_corners" in printed
