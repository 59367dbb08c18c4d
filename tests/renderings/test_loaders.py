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
    assert sorted(shown) == sorted(expected)


def test_entries_count_as_often_as_both_lists_have_them() -> None:
    assert overlap(["a", "a", "b"], ["b", "a", "c"]) == 2
