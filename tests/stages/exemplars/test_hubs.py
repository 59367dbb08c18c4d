"""Hubs left out of the graph: a chain on a long plate, by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from pipeline.errors import ConfigError
from stages.exemplars.build import observe_models
from stages.exemplars.model import Model
from stages.exemplars.settings import HubConfig
from stages.shape.graphs.neighbourhoods import STRICTNESS
from stages.shape.kit_files import load_kit, write_kit
from tests.toy_kits.chains_and_rings import CHAIN, Placed, box, chain, config_of, models_of, pose

MESHES = {**CHAIN, "plate": box(4.5, 0.1, 3.0)}


def on_plate(links: int) -> list[Placed]:
    """Return cap - link - ... - link - cap on a plate, which only the taller caps touch."""
    return [*chain(links), ("plate", pose((links - 1) / 2, -0.55, 0))]


def observe(shapes: list[list[Placed]], meshes: dict[str, trimesh.Trimesh] = MESHES, **changed: Any) -> Any:
    return observe_models(config_of(shapes).model_copy(update=changed), models_of(meshes, shapes))


def test_dropped_hubs_are_neither_in_the_exemplars_nor_among_the_types() -> None:
    with_plate, without = on_plate(3), chain(3)
    observation = observe([with_plate], hubs=HubConfig(types=("plate",), restore=False))
    plain = observe([without])
    assert not observation.refusals
    assert observation.kit.type_names() == plain.kit.type_names() == ("cap", "link")
    assert observation.kit.exemplars[0].part_names == plain.kit.exemplars[0].part_names
    np.testing.assert_array_equal(observation.kit.exemplars[0].assembly.edges, plain.kit.exemplars[0].assembly.edges)
    assert observation.kit.grammar.neighbourhoods == plain.kit.grammar.neighbourhoods
    assert observation.kit.grammar.hubs == ()
    assert any("1 hubs are left out of the graph: plate" in warning for warning in observation.warnings)


def test_restored_hub_is_a_type_with_dockings_that_no_neighbourhood_counts() -> None:
    observation = observe([on_plate(3)], hubs=HubConfig(types=("plate",), restore=True))
    kit = observation.kit
    cap, link, plate = (kit.type_names().index(name) for name in ("cap", "link", "plate"))
    assert kit.grammar.hubs == (plate,)
    assert plate not in kit.exemplars[0].assembly.types
    assert kit.grammar.neighbourhoods[cap] == {((link, 1),): 2}
    assert kit.grammar.neighbourhoods[plate] == {((cap, 2),): 1}
    assert {(docking.a, docking.b) for docking in kit.grammar.dockings} >= {(cap, plate)}
    assert len(observation.kinds[0]) == len(observation.contacts[0]) == len(kit.exemplars[0].assembly.edges)


def test_kit_with_hubs_and_a_loose_grammar_survives_files(tmp_path: Any) -> None:
    kit = observe([on_plate(3)], hubs=HubConfig(types=("plate",), restore=True), grammar="count_and_pairs").kit
    with (tmp_path / "k.json").open("wb") as text, (tmp_path / "k.tar").open("wb") as arrays:
        write_kit(kit, text, arrays)
    read = load_kit(tmp_path / "k.json", tmp_path / "k.tar").grammar
    assert (read.strictness, read.hubs) == ("count_and_pairs", kit.grammar.hubs)
    assert read.neighbourhoods == kit.grammar.neighbourhoods


def test_exemplar_that_falls_apart_without_its_hub_is_refused() -> None:
    legs = [("cap", pose(-2, 0, 0)), ("cap", pose(2, 0, 0)), ("link", pose(-1.25, 0, 0))]
    legs.append(("plate", pose(0, -0.55, 0)))
    hubs = HubConfig(types=("plate",), restore=False)
    (refusal,) = observe([legs], hubs=hubs).refusals
    assert "the exemplar without its hubs plate falls into 2 pieces of 2, 1 parts" in refusal
    kept = observe([legs], hubs=hubs, disconnected="largest")
    assert not kept.refusals
    assert kept.kit.exemplars[0].part_names == ("cap.000", "link.002")
    behind = observe([legs], hubs=HubConfig(types=("plate",), restore=True), disconnected="largest")
    assert behind.kit.exemplars[0].part_names == ("cap.000", "link.002")
    assert behind.kit.grammar.neighbourhoods[behind.kit.type_names().index("plate")] == {((0, 1),): 1}


def test_kit_with_hubs_at_auto_is_not_built() -> None:
    with pytest.raises(ConfigError, match=r"kit toy: hubs\.types must be resolved"):
        observe([on_plate(3)], hubs=HubConfig())


def test_unknown_hub_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(ConfigError, match="'plat', which is no part type of it; did you mean 'plate'"):
        observe([on_plate(3)], hubs=HubConfig(types=("plat",)))
    with pytest.raises(ConfigError, match="every part of it is of a hub type"):
        observe([on_plate(3)], hubs=HubConfig(types=("plate", "cap", "link")))


def test_loose_grammar_of_parts_with_many_contacts_is_accepted() -> None:
    sizes = np.linspace(0.4, 0.9, 14)
    meshes = {"floor": box(40.0, 0.1, 2.0), **{f"t{index}": box(size, size, size) for index, size in enumerate(sizes)}}
    shape: list[Placed] = [("floor", pose(0, -0.05, 0))]
    shape += [(f"t{index % 14}", pose(1.2 * index - 16, sizes[index % 14] / 2, 0)) for index in range(28)]
    for strictness in STRICTNESS:
        assert not observe([shape], meshes, grammar=strictness).refusals


def renamed(model: Model, turn: np.ndarray) -> Model:
    """Return the model with other names and with rotated meshes, undone by their poses."""
    parts = []
    for part in model.parts:
        new = part.pose @ np.linalg.inv(turn)
        name = part.mesh_name[::-1]
        vertices = part.vertices @ turn[:3, :3].T
        changes = {"name": f"other {part.name}", "mesh_name": name, "label": name, "pose": new, "vertices": vertices}
        parts.append(type(part)(**{**vars(part), **changes}))
    return Model(model.path.with_name("renamed.glb"), tuple(parts), "nodes", "", ())


def test_renamed_and_rotated_copy_has_the_same_types_and_aliases() -> None:
    shapes = [chain(3)]
    model = models_of(CHAIN, shapes)[0]
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    observation = observe_models(config_of([*shapes, *shapes]), [model, renamed(model, turn)])
    alone = observe_models(config_of(shapes), [model])
    assert not observation.refusals
    assert observation.kit.type_names() == ("cap", "link")
    assert observation.aliases == {"cap": ("pac",), "link": ("knil",)}
    assert alone.aliases == {}
    first, second = (exemplar.assembly for exemplar in observation.kit.exemplars)
    np.testing.assert_array_equal(first.types, second.types)
    np.testing.assert_array_equal(first.edges, second.edges)
    assert len(observation.kit.grammar.dockings) == len(alone.kit.grammar.dockings)
