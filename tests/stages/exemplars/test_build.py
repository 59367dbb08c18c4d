"""A kit is built from models: types, labels, pieces, hubs and refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.exemplars.build import build_kit, observe_models
from stages.exemplars.diagnostics import connected_pieces, hub_parts, mirror_twins
from stages.exemplars.model import STATED_IN_CONFIG, Model
from stages.exemplars.read import read_parts
from stages.exemplars.settings import ContactConfig
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Assembly
from tests.stages.exemplars.blocks import CUBE, SLAB, block_config, block_kit, model, raw_part, ring
from tests.stages.exemplars.model_files import BOX_FACES, Glb
from tests.stages.exemplars.model_files import box as file_box
from tests.stages.shape.geometry.bodies import box, joined, placed, random_rotation

SCREW = joined(box(), box(at=(1, 0, 0)), box(at=(1, 1, 0)), box(at=(1, 1, 1)))
MIRROR_SCREW = SCREW[0] * [1, 1, -1], np.ascontiguousarray(SCREW[1][:, ::-1])
FAR = [0.0, 0.0, 50.0]


def refusal(*models: Model, **settings: object) -> str:
    with pytest.raises(ConfigError) as caught:
        build_kit(block_config(**settings), models)
    return str(caught.value)


class TestTypes:
    def test_parts_come_back_where_they_were(self) -> None:
        rng = np.random.default_rng(1)
        parts = []
        for k in range(6):
            vertices, faces = SCREW if k % 2 else SLAB
            # Each mesh stands in coordinates of its own.
            turned = transform_points(placed(*rng.normal(size=3), random_rotation(rng)), vertices)
            parts.append(raw_part(f"p{k}", (turned, faces), placed(0.8 * k, 0, 0, random_rotation(rng))))
        model_of = Model(Path("mixed.glb"), tuple(parts), "nodes", "", ())
        kit = observe_models(block_config(), [model_of]).kit
        assembly = kit.exemplars[0].assembly
        assert assembly.types.tolist() == [0, 1] * 3
        assert kit.exemplars[0].part_names == tuple(f"p{k}" for k in range(6))
        for part, index, pose in zip(parts, assembly.types, assembly.poses, strict=True):
            world = transform_points(part.pose, part.vertices)
            again = transform_points(pose, kit.types[index].vertices)
            gaps = np.linalg.norm(world[:, None] - again[None], axis=2)
            assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-6

    @pytest.mark.parametrize(("cut_by", "one_surface"), [("sections", True), ("symmetry", True), ("components", False)])
    def test_parts_that_a_surface_was_cut_into_are_one_surface(self, cut_by: Any, one_surface: bool) -> None:
        assert block_kit(replace(ring(), segmentation=cut_by)).one_surface is one_surface

    def test_origin_of_a_type_is_its_centroid(self) -> None:
        kit = block_kit(model({"a": (SCREW, (0, 0, 0)), "b": (SCREW, (2, 0, 0))}))
        np.testing.assert_allclose(kit.types[0].centroid, 0, atol=1e-12)

    def test_mirror_images_are_one_type_only_if_the_config_says_so(self) -> None:
        pair = model({"left": (SCREW, (0, 0, 0)), "right": (MIRROR_SCREW, (0, 0, -1))})
        kit = block_kit(pair)
        assert kit.type_names() == ("left", "right")
        assert mirror_twins(kit.types, 1e-3) == [(0, 1)]
        assert block_kit(pair, mirror_images_match=True).type_names() == ("left",)

    def test_parts_that_are_their_own_mirror_image_have_no_twin(self) -> None:
        kit = block_kit(model({"slab": (SLAB, (0, 0, 0)), "cube": (CUBE, (1, 0, 0))}))
        assert mirror_twins(kit.types, 1e-3) == []

    def test_labels_tell_congruent_parts_apart_if_the_config_says_so(self) -> None:
        parts = [raw_part(f"{label}.{k}", CUBE, placed(float(k)), label) for k, label in enumerate("aabba")]
        model_of = Model(Path("labels.glb"), tuple(parts), "nodes", "", ())
        assert block_kit(model_of).exemplars[0].assembly.types.tolist() == [0] * 5
        kit = block_kit(model_of, types="labels")
        assert kit.exemplars[0].assembly.types.tolist() == [0, 0, 1, 1, 0]
        assert kit.type_names() == ("a", "b")
        assert mirror_twins(kit.types, 1e-3) == []

    def test_names_of_types_are_words_and_differ(self) -> None:
        bodies = [("wall #1", CUBE), ("wall 1", SLAB), ("!", box(1, 1, 3)), ("...", box(1, 1, 4))]
        kit = block_kit(model({name: (body, (float(k), 0.0, 0.0)) for k, (name, body) in enumerate(bodies)}))
        assert kit.type_names() == ("wall_1", "wall_1_2", "part", "part_2")

    def test_type_is_shared_by_the_shapes_of_a_kit(self) -> None:
        kit = block_kit(ring(), model({"x": (SLAB, (0, 0, 0)), "y": (CUBE, (1, 0, 0.5))}, "other"))
        assert [exemplar.assembly.types.tolist() for exemplar in kit.exemplars] == [[0, 0, 0, 0], [1, 0]]
        assert [exemplar.name for exemplar in kit.exemplars] == ["ring", "other"]

    def test_shapes_in_files_of_one_name_are_called_by_their_folders(self) -> None:
        models = [Model(Path(folder, "model.glb"), ring().parts, "nodes", "", ()) for folder in ("tower", "wall")]
        assert [exemplar.name for exemplar in block_kit(*models).exemplars] == ["tower", "wall"]


class TestRepairs:
    def test_doubled_faces_and_split_vertices_do_not_make_another_type(self) -> None:
        vertices, faces = CUBE
        soup = vertices[np.concatenate([faces, faces])].reshape(-1, 3)
        doubled = soup, np.arange(len(soup), dtype=np.int32).reshape(-1, 3)
        kit, observation = build_kit(
            block_config(), [model({"plain": (CUBE, (0, 0, 0)), "doubled": (doubled, (1, 0, 0))})]
        )
        assert kit.type_names() == ("plain",)
        assert observation.repairs["duplicate_faces"] == 12
        assert observation.repairs["merged_vertices"] > 0


class TestRefusals:
    def test_one_part_is_no_exemplar(self) -> None:
        alone = model({"only": (CUBE, (0, 0, 0))})
        message = refusal(alone)
        assert message.startswith("blocks.glb: has 1 part by nodes (1 scene nodes)")
        assert "split the model into one scene node a part" in message
        assert "parts: auto" not in message
        assert "set `parts: auto`" in refusal(replace(alone, why=STATED_IN_CONFIG))

    def test_exemplar_in_pieces_is_refused_with_what_is_apart(self) -> None:
        apart = model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, (1, 0, 0)), "c": (CUBE, (2, 0, 0)), "moon": (CUBE, FAR)})
        message = refusal(apart)
        assert "2 pieces of 3, 1 parts (apart: moon)" in message
        assert "disconnected: largest" in message

    def test_largest_piece_is_kept_if_the_config_says_so(self) -> None:
        apart = model({"moon": (CUBE, FAR), "a": (CUBE, (0, 0, 0)), "b": (CUBE, (1, 0, 0)), "c": (CUBE, (2, 0, 0))})
        kit, observation = build_kit(block_config(disconnected="largest"), [apart])
        assert kit.exemplars[0].part_names == ("a", "b", "c")
        assert kit.exemplars[0].assembly.edges.tolist() == [[0, 1], [1, 2]]
        assert kit.grammar.neighbourhoods == {0: {((0, 1),): 2, ((0, 2),): 1}}
        assert any("moon" in warning for warning in observation.warnings)

    def test_pieces_of_single_parts_are_no_exemplar(self) -> None:
        apart = model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, (3, 0, 0))})
        assert "needs at least 2" in refusal(apart, disconnected="largest")

    def test_shapes_without_a_common_type_are_refused_by_name(self) -> None:
        cubes, slabs = (
            model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, (1, 0, 0))}, "cubes"),
            model({"a": (SLAB, (0, 0, 0)), "b": (SLAB, (1, 0, 0))}, "slabs"),
        )
        message = refusal(cubes, slabs)
        assert "cubes.glb: shares no part type" in message
        assert "slabs.glb: shares no part type" in message
        build_kit(block_config(), [cubes, slabs, model({"a": (SLAB, (0, 0, 0)), "b": (CUBE, (1, 0, 0))}, "both")])

    def test_model_of_nothing_but_triangles_without_area_is_refused(self) -> None:
        line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]), np.array([[0, 1, 2]], dtype=np.int32)
        assert "no part has a triangle with area" in refusal(model({"a": (line, (0, 0, 0)), "b": (line, (1, 0, 0))}))

    def test_refused_models_can_be_observed(self) -> None:
        observation = observe_models(block_config(), [model({"only": (CUBE, (0, 0, 0))})])
        assert len(observation.refusals) == 1
        assert len(observation.kit.types[0].symmetries) == 24


class TestLeftOut:
    def test_coincident_parts_are_left_out_and_named(self) -> None:
        quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
        again = [raw_part(name, CUBE, placed(1, 0, 0, quarter)) for name in ("again", "and again")]
        model_of = Model(Path("thrice.glb"), (again[0], *ring().parts, again[1]), "nodes", "", ())
        kit, observation = build_kit(block_config(), [model_of])
        assert kit.exemplars[0].part_names == ("again", "cube.0", "cube.2", "cube.3")
        assert len(kit.exemplars[0].assembly.edges) == len(block_kit(ring()).exemplars[0].assembly.edges)
        (warning,) = (warning for warning in observation.warnings if "left out" in warning)
        assert "thrice.glb: 2 parts are left out of the model: " in warning
        assert "cube.1 (it coincides with again), and again (it coincides with" in warning

    def test_nested_parts_are_kept(self) -> None:
        eighth = np.array([[1, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
        parts = (*ring().parts, raw_part("turned", CUBE, placed(1, 0, 0, eighth)))
        observation = observe_models(block_config(), [Model(Path("turned.glb"), parts, "nodes", "", ())])
        assert len(observation.kit.exemplars[0].assembly) == len(ring().parts) + 1

    def test_part_without_area_is_left_out_and_named(self) -> None:
        flat = CUBE[0], np.array([[0, 1, 1], [2, 2, 2]], dtype=np.int32)
        parts = model({"a": (CUBE, (0, 0, 0)), "ghost": (flat, (2, 0, 0)), "b": (CUBE, (1, 0, 0))})
        kit, observation = build_kit(block_config(), [parts])
        assert kit.exemplars[0].part_names == ("a", "b")
        assert [
            warning
            for warning in observation.warnings
            if "1 part is left out of the model: ghost (it has no tri" in warning
        ]


class TestWarnings:
    def test_kit_in_which_nothing_repeats_says_that_nothing_can_be_exchanged(self) -> None:
        _, observation = build_kit(block_config(), [model({"a": (CUBE, (0, 0, 0)), "b": (SLAB, (1, 0, 0))})])
        assert any("little or nothing can be exchanged" in warning for warning in observation.warnings)
        _, observation = build_kit(block_config(), [ring()])
        assert observation.warnings == ()

    def test_three_hundred_types_make_a_kit_and_say_how_strings_write_them(self) -> None:
        sizes = 1.0 + 0.05 * np.arange(300)
        middles = np.cumsum(sizes) - sizes / 2
        parts = {
            f"block.{k}": (box(size, 1, 1), (middle, 0.0, 0.0))
            for k, (size, middle) in enumerate(zip(sizes.tolist(), middles.tolist(), strict=True))
        }
        parts["twin"] = (box(1, 1, 1), (0.5, 1.0, 0.0))
        kit, observation = build_kit(block_config(), [model(parts)])
        assert len(kit.types) == 300
        assert len(kit.exemplars[0].assembly.edges) == 301
        assert any("300 part types" in warning for warning in observation.warnings)

    def test_part_with_many_contacts_is_a_hub(self) -> None:
        floor = {"floor": (box(30, 2, 1), (15, 0, -1))}
        posts = {f"post.{k}": (CUBE, (1 + 1.3 * k, 0.0, 0.0)) for k in range(20)}
        kit, observation = build_kit(block_config(), [model(floor | posts)])
        assert hub_parts(kit.exemplars[0].assembly) == [0]
        assert any("floor (20)" in warning for warning in observation.warnings)

    def test_small_shapes_have_no_hubs(self) -> None:
        assert hub_parts(block_kit(ring()).exemplars[0].assembly) == []

    def test_many_contacts_are_a_hub_in_the_largest_shape_too(self) -> None:
        edges = np.array([[0, k] for k in range(1, 22)] + [[30, k] for k in range(31, 51)], dtype=np.int32)
        assembly = Assembly(np.zeros(900, np.int16), np.tile(np.eye(4), (900, 1, 1)), edges)
        assert hub_parts(assembly) == [0]


class TestPieces:
    def test_pieces_are_numbered_from_the_largest(self) -> None:
        edges = np.array([[1, 2], [3, 4], [4, 5]], dtype=np.int32)
        assembly = Assembly(np.zeros(6, np.int16), np.tile(np.eye(4), (6, 1, 1)), edges)
        assert connected_pieces(assembly).tolist() == [2, 1, 1, 0, 0, 0]

    @pytest.mark.parametrize(("stated", "named"), [(1e-3, "0.005"), (2e-3, "0.004"), (3e-3, "0.006")])
    def test_proposed_tolerance_joins_the_pieces(self, stated: float, named: str) -> None:
        apart = model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, (1 + 0.0038 * np.sqrt(3), 0, 0))})
        assert f"set `contact.tolerance: {named}`" in refusal(apart, contact=ContactConfig(tolerance=stated))
        joined = block_kit(apart, contact=ContactConfig(tolerance=float(named)))
        assert joined.exemplars[0].assembly.edges.tolist() == [[0, 1]]

    def test_proposed_tolerance_is_allowed_in_a_config(self) -> None:
        apart = model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, (1 + 0.045 * np.sqrt(3), 0, 0))})
        assert "set `contact.tolerance: 0.05`" in refusal(apart, contact=ContactConfig(tolerance=0.04))
        far = model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, (1 + 0.06 * np.sqrt(3), 0, 0))})
        message = refusal(far, contact=ContactConfig(tolerance=0.04))
        assert "no contact tolerance joins them, so move the parts together in the model" in message

    def test_mend_considers_contacts_that_do_not_count(self) -> None:
        corner = model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, (1, 1, 1))})
        message = refusal(corner, contact=ContactConfig(kinds=("face",)))
        assert "set `contact.kinds: [point, line, face]`" in message
        block_kit(corner, contact=ContactConfig(kinds=("point", "line", "face")))

    def test_mends_depend_on_the_sizes_of_pieces(self) -> None:
        scattered = model({"a": (CUBE, (0, 0, 0)), "b": (CUBE, FAR)})
        assert "disconnected: largest" not in refusal(scattered)
        assert "model of its own" not in refusal(scattered)
        halves = [{"a": (CUBE, (x, 0, 0)), "b": (CUBE, (x + 1, 0, 0))} for x in (0, 9)]
        both = {f"{name}.{x}": part for x, half in enumerate(halves) for name, part in half.items()}
        assert "export each piece as a model of its own" in refusal(model(both))
        block_kit(*map(model, halves))


def test_model_a_million_units_away_has_the_same_contacts(tmp_path: Path) -> None:
    kits = []
    for shift in (0.0, 1e6):
        glb = Glb()
        cube = glb.mesh(glb.primitive(file_box(), BOX_FACES), name="cube")
        for k in range(5):
            glb.node(name=f"cube.{k}", mesh=cube, translation=[shift + k, shift, 0.0])
        glb.node(name="on top", mesh=cube, translation=[shift + 0.5, shift + 1.0, 0.0])
        model_of = read_parts(glb.write(tmp_path / f"{shift:g}.glb"))
        kits.append((block_kit(model_of), model_of.warnings))
    (near, quiet), (away, warned) = kits
    assert away.exemplars[0].assembly.edges.tolist() == near.exemplars[0].assembly.edges.tolist()
    assert len(near.exemplars[0].assembly.edges) == 6
    assert [docking.kind for docking in away.grammar.dockings] == [docking.kind for docking in near.grammar.dockings]
    assert quiet == ()
    assert "units from the origin" in warned[0]


def test_building_twice_gives_the_same_kit() -> None:
    from stages.shape.kit_files import kit_json

    models = [ring(), model({"a": (CUBE, (0, 0, 0)), "b": (SLAB, (1, 0, 0))}, "two")]
    assert kit_json(block_kit(*models)) == kit_json(block_kit(*models))
