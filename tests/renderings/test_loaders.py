"""What counts as a shown texture."""

from __future__ import annotations

import io

import trimesh

from stages.package.glb import glb_bytes
from tests.renderings.loaders import overlap, stored, trimesh_look
from tests.stages.package.test_glb_materials import textured


def test_the_look_that_a_file_holds_is_the_one_that_trimesh_shows() -> None:
    content = glb_bytes(textured())
    expected = stored(content)
    shown = trimesh_look(trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False))
    assert {name for name, _ in expected} == {"tiles", "leaves"}
    assert overlap(expected, shown, with_names=True) == len(expected) == len(shown)


def test_entries_count_as_often_as_both_looks_have_them() -> None:
    red, blue = (4, 4, 200.0, 0.0, 0.0), (4, 4, 0.0, 0.0, 200.0)
    expected, found = [("a", red), ("a", red), ("b", blue)], [("b", blue), ("c", (4, 4, 201.0, 0.0, 0.0))]
    assert overlap(expected, found, with_names=False) == 2
    assert overlap(expected, found, with_names=True) == 1
