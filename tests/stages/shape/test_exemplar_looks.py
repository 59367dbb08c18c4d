"""Parts of variants look like the parts of exemplars that they stand for."""

from __future__ import annotations

import io
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from stages.model_files.enclosure import Enclosure
from stages.model_files.gltf import read_gltf
from stages.package.glb import glb_bytes
from stages.rows.draws import LayoutDraws
from stages.rows.layout import layout_of
from stages.rows.settings import RowsConfig
from stages.shape.appearance import Appearance, Look, Material
from stages.shape.exemplar_looks import exemplar_looks
from stages.shape.geometry.pose import rounded
from stages.shape.kit import Assembly, Exemplar, Kit
from stages.shape.kit_files import load_kit, write_kit
from stages.shape.shape import Z_TO_Y, Shape, kit_shape
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose

NAMES = ("pepper", "basil", "curry", "thyme")
JARS_PER_SHELF = 4
SHELF: list[Placed] = [
    ("board", pose(1.5, 0.05, 0.0)),
    ("post", pose(-0.6, 0.6, 0.0)),
    *(("jar", pose(float(place), 0.3, 0.0)) for place in range(JARS_PER_SHELF)),
]


@cache
def shelves(count: int = 1) -> Kit:
    """Return a kit of shelves with four jars of four looks; those of the second shelf are in reverse order."""
    kit = kit_of({"board": box(5.0, 0.1, 1.0), "post": box(0.1, 1.0, 0.1), "jar": box(0.4, 0.4, 0.4)}, [SHELF])
    types = []
    for kind in kit.types:
        looks = [
            Look(kind.face_colors, Appearance((Material(name),), np.zeros(len(kind.faces), np.int32)))
            for name in (NAMES if kind.name == "jar" else ("wood",))
        ]
        types.append(replace(kind, appearance=looks[0].appearance, other_looks=tuple(looks[1:])))
    (exemplar,) = kit.exemplars
    jar = kit.type_names().index("jar")
    exemplars = []
    for number in range(count):
        looks_of = np.zeros(len(exemplar.assembly), np.int16)
        looks_of[exemplar.assembly.types == jar] = np.arange(JARS_PER_SHELF)[:: 1 if number == 0 else -1]
        assembly = replace(exemplar.assembly, looks=looks_of)
        exemplars.append(Exemplar(f"shelf{number}", assembly, exemplar.part_names))
    return replace(kit, types=tuple(types), exemplars=tuple(exemplars))


def spices(shape: Shape) -> list[str]:
    """Return the material of each jar from left to right."""
    jars = [part for part, name in enumerate(shape.part_names) if name.startswith("jar")]
    jars.sort(key=lambda part: float(shape.assembly.poses[part, 0, 3]))
    materials = []
    for part in jars:
        look = shape.meshes[shape.assembly.types[part]].appearance
        assert look is not None
        materials.append(look.materials[look.face_material[0]].name)
    return materials


def without_looks(assembly: Assembly) -> Assembly:
    return replace(assembly, looks=None)


@pytest.mark.parametrize("number", [0, 1])
def test_an_exemplar_keeps_its_own_looks(number: int) -> None:
    kit = shelves(2)
    expected = list(NAMES) if number == 0 else list(NAMES[::-1])
    assert spices(kit_shape(kit, kit.exemplars[number].whole)) == expected


def test_parts_of_equal_geometry_are_found_again_wherever_the_shape_is() -> None:
    kit = shelves()
    whole = without_looks(kit.exemplars[0].whole)
    turn = np.diag([-1.0, 1.0, -1.0, 1.0])
    turn[:3, 3] = 5.0, 1.0, 2.0
    for motion in (np.eye(4), turn, Z_TO_Y):
        moved = replace(whole, poses=rounded(motion @ whole.poses))
        assert exemplar_looks(kit, moved).tolist() == exemplar_looks(kit, kit.exemplars[0].whole).tolist()


def test_a_longer_row_shows_its_looks_in_their_order() -> None:
    kit = shelves()
    whole = without_looks(kit.exemplars[0].whole)
    jars = np.flatnonzero(whole.types == kit.type_names().index("jar"))
    poses = np.concatenate([whole.poses, whole.poses[jars[1:3]]])
    poses[jars[3], 0, 3] += 2.0
    poses[len(whole) :, 0, 3] += 2.0
    longer = Assembly(np.append(whole.types, whole.types[jars[1:3]]), poses, whole.edges)
    assert spices(kit_shape(kit, longer)) == ["pepper", "basil", "curry", "thyme", "curry", "thyme"]


def test_rows_copy_the_looks_of_their_parts() -> None:
    kit = shelves()
    layout = layout_of(kit, kit.exemplars[0])
    draws, rng = LayoutDraws(layout, RowsConfig()), np.random.default_rng(1)
    lengths = set()
    for _ in range(10):
        drawn = draws.draw(rng)
        assert drawn is not None
        longer = drawn[1]
        jars = np.flatnonzero(longer.types == kit.type_names().index("jar"))
        jars = jars[np.argsort(longer.poses[jars, 0, 3])]
        first = int(np.flatnonzero(layout.types == longer.types[jars[0]])[0])
        assert spices(longer.shape(kit)) == [NAMES[part - first] for part in longer.origins[jars].tolist()]
        lengths.add(len(jars))
    assert max(lengths) > JARS_PER_SHELF


def test_jars_outside_of_all_pieces_are_always_mixed_in_the_same_way() -> None:
    kit = shelves()
    jar = kit.type_names().index("jar")
    poses = np.tile(np.eye(4), (12, 1, 1))
    poses[:, 0, 3] = np.arange(12) ** 1.5 * 10.0
    heap = Assembly(np.full(12, jar, np.int16), poses, np.empty((0, 2), np.int32))
    found = spices(kit_shape(kit, heap))
    assert len(set(found)) > 1
    assert spices(kit_shape(kit, heap)) == found


def test_a_kit_with_several_looks_is_read_back_from_disk(tmp_path: Path) -> None:
    kit = shelves(2)
    text, arrays = io.BytesIO(), io.BytesIO()
    write_kit(kit, text, arrays)
    (tmp_path / "kit.json").write_bytes(text.getvalue())
    (tmp_path / "kit.tar").write_bytes(arrays.getvalue())
    again = load_kit(tmp_path / "kit.json", tmp_path / "kit.tar")
    for before, after in zip(kit.exemplars, again.exemplars, strict=True):
        assert spices(kit_shape(again, after.whole)) == spices(kit_shape(kit, before.whole))


def test_looks_of_a_type_share_their_arrays_in_the_glb(tmp_path: Path) -> None:
    kit = shelves()
    shape = kit_shape(kit, kit.exemplars[0].whole)
    content = glb_bytes(shape)
    one_look = glb_bytes(kit_shape(kit, replace(kit.exemplars[0].whole, looks=np.zeros(len(shape), np.int16))))
    assert len(content) < len(one_look) + 3 * 600
    path = tmp_path / "shelf.glb"
    path.write_bytes(content)
    scene = read_gltf(path, Enclosure(path))
    names = []
    for placement in scene.placements:
        look = scene.surfaces[placement.surface].appearance
        assert look is not None
        names.append(look.materials[look.face_material[0]].name)
    assert [name for name in names if name != "wood"] == list(NAMES)


def test_a_wall_of_many_equal_bricks_is_found_again_in_moderate_time() -> None:
    kit = shelves()
    jar = kit.type_names().index("jar")
    rng = np.random.default_rng(1)
    poses = np.tile(np.eye(4), (400, 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = np.arange(400) % 20, np.arange(400) // 20
    no_edges = np.empty((0, 2), np.int32)
    wall = Assembly(
        np.full(400, jar, np.int16), poses, no_edges, looks=rng.integers(0, JARS_PER_SHELF, 400).astype(np.int16)
    )
    kit = replace(kit, exemplars=(Exemplar("wall", wall, ("brick",) * 400),))
    start = time.process_time()
    found = exemplar_looks(kit, without_looks(wall))
    assert time.process_time() - start < 5.0
    assert wall.looks is not None
    assert found.tolist() == wall.looks.tolist()
