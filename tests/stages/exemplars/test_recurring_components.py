"""Objects of many pieces: what recurs becomes parts, what belongs together stays together."""

from __future__ import annotations

import numpy as np
import trimesh

from stages.exemplars.recurring_components import divide_objects
from stages.exemplars.segmentation import pick_segmentation
from stages.model_files.scene import ModelScene, Placement, Surface
from tests.toy_kits.chains_and_rings import box


def surface(name: str, *meshes: trimesh.Trimesh) -> Surface:
    whole = trimesh.util.concatenate(meshes)
    colors = np.full((len(whole.faces), 3), 128, dtype=np.uint8)
    return Surface(name, np.array(whole.vertices), np.array(whole.faces, dtype=np.int32), colors)


def scene(*surfaces: Surface) -> ModelScene:
    placements = tuple(Placement(object_.name, None, index, np.eye(4)) for index, object_ in enumerate(surfaces))
    return ModelScene("objects", surfaces, placements)


def blind() -> ModelScene:
    """A frame, and an object of five slats and one rod."""
    slats = [box(1.0, 0.02, 0.1).apply_translation((0.0, 0.2 * number, 0.0)) for number in range(5)]
    rod = box(0.02, 1.2, 0.02).apply_translation((0.3, 0.4, 0.2))
    return scene(surface("frame", box(1.2, 0.1, 0.1)), surface("slats", *slats, rod))


def chest() -> ModelScene:
    """A body, and an object of four drawers, each a front with a handle before it."""
    pieces = []
    for number in range(4):
        pieces.append(box(0.8, 0.2, 0.02).apply_translation((0.0, 0.25 * number, 0.0)))
        pieces.append(box(0.1, 0.02, 0.02).apply_translation((0.0, 0.25 * number, 0.02)))
    return scene(surface("body", box(1.0, 1.2, 0.5)), surface("drawers", *pieces))


def test_slats_become_parts_with_the_name_of_their_object_and_the_rest_stays_one() -> None:
    divided, said = divide_objects(blind()) or (None, "")
    assert divided is not None
    assert said == "slats holds 6 pieces"
    assert [placement.label for placement in divided.placements] == [None, *["slats"] * 6]
    assert sorted(len(part.faces) for part in divided.surfaces) == [12] * 7
    assert len({placement.name for placement in divided.placements}) == 7


def test_what_always_comes_together_is_one_part() -> None:
    divided, _ = divide_objects(chest()) or (None, "")
    assert divided is not None
    assert [len(part.faces) for part in divided.surfaces] == [12, 24, 24, 24, 24]


def test_pieces_are_those_of_the_object() -> None:
    before = blind()
    divided, _ = divide_objects(before) or (None, "")
    assert divided is not None
    areas = [sum(trimesh.Trimesh(part.vertices, part.faces, process=False).area for part in whole.surfaces)
             for whole in (before, divided)]  # fmt: skip
    np.testing.assert_allclose(areas[0], areas[1])


def test_shared_surfaces_and_many_objects_stay_as_they_are() -> None:
    one = surface("slats", *[box(1, 0.1, 0.1).apply_translation((0, number, 0)) for number in range(3)])
    shared = ModelScene("nodes", (one,), tuple(Placement(f"n{k}", None, 0, np.eye(4)) for k in range(2)))
    assert divide_objects(shared) is None
    assert divide_objects(scene(*(surface(f"o{number}", box(1, 1, 1)) for number in range(20)))) is None
    assert divide_objects(scene(surface("a", box(1, 1, 1)), surface("b", box(1, 2, 1)))) is None


def test_auto_names_what_it_divides() -> None:
    source, why, parts = pick_segmentation(blind())
    assert (source, why) == ("objects", "2 named objects; slats holds 6 pieces")
    assert len(parts.placements) == 7
