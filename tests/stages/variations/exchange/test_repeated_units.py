"""Repeating and removing what stands several times in a row, on shapes whose rows are known by heart."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from stages.shape.assembly_faults import assembly_faults
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly, Kit
from stages.variations.exchange.repeated_units import shift
from stages.variations.kernels.structs import BOUNDARY, PLANES, UNITS, Outcome
from stages.variations.search.operator_selection import PlannedTry
from stages.variations.search.search import Search, Variant
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, chain, kit_of, ring


def line_of(kit: Kit) -> Search:
    return Search(ContactOracle(kit), SearchConfig(method="exchange", duplicates="graph"))


def made_by(line: Search, way: int, tries: int) -> list[Variant]:
    """What so many tries with nothing but the exemplars make, each the first of its graph."""
    rng, found = np.random.default_rng(0), []
    for number in range(tries):
        a = line.parents.exemplars[number % len(line.parents.exemplars)]
        variant = line._attempt(rng, PlannedTry(0, a, a, way, False))
        if isinstance(variant, Variant):
            line.seen.add(line.key(variant.assembly.types, variant.graph, variant.docked))
            found.append(variant)
    return found


def size(kit: Kit, assembly: Assembly) -> tuple[int, ...]:
    """Straights along either pair of sides of a ring."""
    straight = assembly.types == kit.type_names().index("straight")
    sideways = np.abs(assembly.poses[straight, 0, 0]) < 0.5
    return int((~sideways).sum()), int(sideways.sum())


def test_a_chain_gets_longer_and_shorter_by_the_links_between_two() -> None:
    kit = kit_of(CHAIN, [chain(5)])
    found = made_by(line_of(kit), UNITS, 2000)
    # of five links: up to four repeated, up to three removed, and no fewer than half of the parts
    assert {len(each.assembly) - 2 for each in found} == {2, 3, 4, 6, 7, 8, 9}
    assert not any(assembly_faults(kit, each.assembly) for each in found)


def test_both_sides_of_a_ring_are_cut_at_once() -> None:
    kit = kit_of(ROAD, [ring(2, 3)])
    found = {size(kit, each.assembly): each for each in made_by(line_of(kit), UNITS, 4000)}
    # no exemplar shows a straight between two corners, so of two straights none is removed, and of three one
    assert set(found) == {(6, 6), (4, 4), (4, 8), (4, 10)}
    assert not any(assembly_faults(kit, each.assembly) for each in found.values())


def test_every_part_of_the_boundary_stands_in_the_place_of_its_image_after_the_shift() -> None:
    line = line_of(kit_of(ROAD, [ring(2, 3)]))
    shape, ws, rng = line.parents.exemplars[0].tables, line._ws, np.random.default_rng(2)
    docked = 0
    for _ in range(200):
        if shift(rng, line.tables, shape, ws) == Outcome.OK:
            docked += 1
            count = ws.counts[BOUNDARY]
            moved = shape.translations[ws.boundary[:count]] + ws.motion[3]
            np.testing.assert_allclose(moved, shape.translations[ws.images[:count]], atol=line.tables.limits[0])
            assert np.array_equal(shape.types[ws.boundary[:count]], shape.types[ws.images[:count]])
    assert docked > 20


@pytest.mark.parametrize("way", [UNITS, PLANES])
def test_a_model_in_other_units_has_the_same_variants(way: int) -> None:
    made = []
    for scale in (1.0, 2.0**-20):
        meshes = {
            name: trimesh.Trimesh(scale * each.vertices, each.faces, process=False) for name, each in ROAD.items()
        }
        shape: list[Placed] = [(name, at * np.array([[1, 1, 1, scale]])) for name, at in ring(2, 3)]
        for _, at in shape:
            at[3, 3] = 1.0
        made.append([each.graph for each in made_by(line_of(kit_of(meshes, [shape])), way, 300)])
    assert made[0] == made[1] != []
