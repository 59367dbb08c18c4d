"""Repeating and removing what stands several times in a row, on shapes whose rows are known by heart."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from stages.shape.assembly_faults import assembly_faults
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly, Kit
from stages.variations.exchange.repeated_units import insert_or_remove_unit
from stages.variations.kernels.operators import PLANE_CUT, REPEATED_UNIT
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import N_BOUNDARY
from stages.variations.search.operator_selection import PlannedTry
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, chain, kit_of, ring


def line_of(kit: Kit) -> Search:
    return Search(ContactOracle(kit), SearchConfig(method="exchange", duplicates="graph"))


def made_by(line: Search, way: int, tries: int) -> list[Variant]:
    """Return what a number of tries with the exemplars only make, each the first of its graph."""
    rng, found = np.random.default_rng(0), []
    for number in range(tries):
        a = line.parents.exemplars[number % len(line.parents.exemplars)]
        variant = line.maker.exchange(rng, PlannedTry(0, a, a, way, False))
        if isinstance(variant, Variant):
            line.maker.seen.add(line.maker.key(variant.assembly.types, variant.graph, variant.docked))
            found.append(variant)
    return found


def size(kit: Kit, assembly: Assembly) -> tuple[int, ...]:
    """Straights along either pair of sides of a ring."""
    straight = assembly.types == kit.type_names().index("straight")
    sideways = np.abs(assembly.poses[straight, 0, 0]) < 0.5
    return int((~sideways).sum()), int(sideways.sum())


def test_chain_gains_and_loses_the_links_between_two() -> None:
    kit = kit_of(CHAIN, [chain(5)])
    found = made_by(line_of(kit), REPEATED_UNIT, 2000)
    # of five links: up to four repeated, up to three removed, and no fewer than half of the parts
    assert {len(variant.assembly) - 2 for variant in found} == {2, 3, 4, 6, 7, 8, 9}
    assert not any(assembly_faults(kit, variant.assembly) for variant in found)


def test_repeated_unit_cuts_both_sides_of_a_ring() -> None:
    kit = kit_of(ROAD, [ring(2, 3)], row_neighbourhoods=False)
    found = {size(kit, entry.assembly): entry for entry in made_by(line_of(kit), REPEATED_UNIT, 4000)}
    # no exemplar shows a straight between two corners, so of two straights none is removed, and of three one
    assert set(found) == {(6, 6), (4, 4), (4, 8), (4, 10)}
    assert not any(assembly_faults(kit, variant.assembly) for variant in found.values())


def test_shifted_boundary_coincides_with_its_images() -> None:
    line = line_of(kit_of(ROAD, [ring(2, 3)]))
    shape, ws, rng = line.parents.exemplars[0].tables, line.maker.ws, np.random.default_rng(2)
    docked = 0
    for _ in range(200):
        if insert_or_remove_unit(rng, line.maker.tables, shape, ws) == Outcome.OK:
            docked += 1
            count = ws.counts[N_BOUNDARY]
            moved = shape.translations[ws.boundary[:count]] + ws.transform[3]
            np.testing.assert_allclose(moved, shape.translations[ws.images[:count]], atol=line.maker.tables.limits[0])
            assert np.array_equal(shape.types[ws.boundary[:count]], shape.types[ws.images[:count]])
    assert docked > 20


@pytest.mark.parametrize("way", [REPEATED_UNIT, PLANE_CUT])
def test_units_of_the_model_do_not_matter(way: int) -> None:
    made = []
    for scale in (1.0, 2.0**-20):
        meshes = {
            name: trimesh.Trimesh(scale * entry.vertices, entry.faces, process=False) for name, entry in ROAD.items()
        }
        shape: list[Placed] = [(name, at * np.array([[1, 1, 1, scale]])) for name, at in ring(2, 3)]
        for _, at in shape:
            at[3, 3] = 1.0
        made.append([mesh.graph for mesh in made_by(line_of(kit_of(meshes, [shape])), way, 300)])
    assert made[0] == made[1] != []
