from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from stages.exemplars.settings import ContactConfig
from stages.shape.kit import Kit
from stages.shape.kit_files import kit_json, load_kit, write_kit
from stages.shape.shape import kit_shape
from tests.stages.exemplars.blocks import CUBE, SLAB, block_kit, model, ring
from tests.stages.shape.geometry.bodies import box

INSIDE = {"case": (box(4, 4, 4), (0, 0, 2.5)), "kernel": (CUBE, (0, 0, 2.5)), "foot": (CUBE, (0, 0, 0))}


def make_kit() -> Kit:
    shaft = {"slab": (SLAB, (0, 0, 0)), "top": (CUBE, (0.25, 0, 1.5)), "foot": (CUBE, (0, 0, -1.5))}
    return block_kit(ring(), model(shaft, "shaft"), up="z", contact=ContactConfig(kinds=("line", "face")))


def written(kit: Kit) -> tuple[bytes, bytes]:
    text, arrays = io.BytesIO(), io.BytesIO()
    write_kit(kit, text, arrays)
    return text.getvalue(), arrays.getvalue()


def read_back(kit: Kit, folder: Path) -> Kit:
    text, arrays = written(kit)
    (folder / "kit.json").write_bytes(text)
    (folder / "kit.tar").write_bytes(arrays)
    return load_kit(folder / "kit.json", folder / "kit.tar")


def assert_same_kit(one: Kit, other: Kit) -> None:
    for field in ("name", "contact_tolerance", "pose_tolerance", "contact_kinds", "up"):
        assert getattr(one, field) == getattr(other, field)
    assert one.type_names() == other.type_names()
    for a, b in zip(one.types, other.types, strict=True):
        for field in ("vertices", "faces", "face_colors", "frame", "symmetries"):
            first, second = getattr(a, field), getattr(b, field)
            np.testing.assert_array_equal(first, second)
            assert first.dtype == second.dtype
    for x, y in zip(one.exemplars, other.exemplars, strict=True):
        assert (x.name, x.part_names) == (y.name, y.part_names)
        for field in ("types", "poses", "edges"):
            first, second = getattr(x.assembly, field), getattr(y.assembly, field)
            np.testing.assert_array_equal(first, second)
            assert first.dtype == second.dtype
    assert one.grammar.neighbourhoods == other.grammar.neighbourhoods
    assert one.grammar.nested == other.grammar.nested
    for d, e in zip(one.grammar.dockings, other.grammar.dockings, strict=True):
        assert (d.a, d.b, d.kind, d.count, d.depth) == (e.a, e.b, e.kind, e.count, e.depth)
        np.testing.assert_array_equal(d.pose, e.pose)


def test_a_kit_comes_back_as_it_was_written(tmp_path: Path) -> None:
    kit = make_kit()
    assert_same_kit(read_back(kit, tmp_path), kit)


def test_parts_inside_others_come_back_too(tmp_path: Path) -> None:
    parts = {**INSIDE, "aside": (CUBE, (1, 0, 0)), "under": (box(4, 4, 4), (0, 0, -2.5))}
    kit = block_kit(model(parts), disconnected="largest")
    assert_same_kit(read_back(kit, tmp_path), kit)


def test_a_kit_of_pieces_of_one_surface_says_so_and_its_shapes_do(tmp_path: Path) -> None:
    kit = replace(make_kit(), one_surface=True)
    assert kit_shape(read_back(kit, tmp_path), kit.exemplars[0].assembly).one_surface
    assert not kit_shape(read_back(make_kit(), tmp_path), kit.exemplars[0].assembly).one_surface


def test_the_same_kit_is_written_in_the_same_bytes() -> None:
    assert written(make_kit()) == written(make_kit())


def test_a_kit_that_was_read_is_written_in_the_same_bytes(tmp_path: Path) -> None:
    kit = make_kit()
    assert written(read_back(kit, tmp_path)) == written(kit)


def test_people_read_names_and_no_indices() -> None:
    described = json.loads(written(make_kit())[0])
    assert described == kit_json(make_kit())
    assert [kind["name"] for kind in described["types"]] == ["cube_0", "slab"]
    assert [kind["symmetries"] for kind in described["types"]] == [24, 8]
    assert described["neighbourhoods"]["slab"] == [{"neighbours": {"cube_0": 2}, "seen": 1}]
    assert described["neighbourhoods"]["cube_0"][0] == {"neighbours": {"cube_0": 3}, "seen": 4}
    assert {(docking["a"], docking["b"], docking["kind"]) for docking in described["dockings"]} == {
        ("cube_0", "cube_0", "face"),
        ("cube_0", "cube_0", "line"),
        ("cube_0", "slab", "face"),
    }
    assert described["exemplars"][1]["parts"][0] == {"name": "slab", "type": "slab"}
    assert described["exemplars"][0]["contacts"][:2] == [[0, 1, "face"], [0, 2, "line"]]
