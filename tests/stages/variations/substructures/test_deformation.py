"""Bent pieces: each part goes where the boundary near it goes, and what then does not meet is refused."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.settings import SearchConfig
from stages.variations.substructures.deformation import deform, is_oriented_alike
from stages.variations.substructures.docking_sites import docking_graph
from stages.variations.substructures.embedding import Side
from stages.variations.substructures.ordered_graph import ordered_graph
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose, with_arrow

GATE = {
    "floor": with_arrow(box(10.0, 0.2, 3.0)),
    "post": with_arrow(box(0.5, 2.0, 0.5)),
    "bar": with_arrow(box(4.5, 0.2, 0.5)),
    "knob": with_arrow(box(0.6, 0.2, 0.6)),
}


def posts(*places: float) -> list[Placed]:
    return [("floor", pose(0, 0, 0)), *(("post", pose(x, 1.1, 0)) for x in places)]


@pytest.fixture(scope="module")
def kit() -> Kit:
    """Two posts with a bar across, and two that stand farther apart, each with a knob."""
    barred = [*posts(-2, 2), ("bar", pose(0, 2.2, 0))]
    knobbed = [*posts(-4, 3.5), ("knob", pose(-4, 2.2, 0)), ("knob", pose(3.5, 2.2, 0))]
    return kit_of(GATE, [barred, knobbed])


def side(kit: Kit, assembly: Assembly) -> Side:
    labels = ContactOracle(kit).dockings.label_edges(assembly.types, assembly.poses, assembly.edges)
    return Side(assembly, docking_graph(kit, assembly, labels))


def named(kit: Kit, assembly: Assembly, name: str) -> np.ndarray:
    found: np.ndarray = assembly.types == [part_type.name for part_type in kit.types].index(name)
    return found


def cut(of: Side, inside: np.ndarray) -> np.ndarray:
    """The darts that lead from other parts to those `inside`, by where the parts that they come from stand along x."""
    tails, heads = of.graph.tails, of.graph.tails[of.graph.twins]
    darts = np.flatnonzero(~inside[tails] & inside[heads])
    return darts[np.argsort(of.assembly.poses[tails[darts], 0, 3])]


def test_boundary_parts_follow_the_boundary(kit: Kit) -> None:
    base, giver = (side(kit, exemplar.assembly) for exemplar in kit.exemplars)
    piece = named(kit, giver.assembly, "knob")
    rows = np.stack([cut(base, named(kit, base.assembly, "bar")), cut(giver, piece)], axis=1)
    moved = deform(kit, base, giver, rows, piece) @ giver.assembly.poses[piece]
    before, after = (entry.assembly.poses[named(kit, entry.assembly, "post")] for entry in (giver, base))
    knobs = giver.assembly.poses[piece]
    np.testing.assert_allclose(invert(after) @ moved, invert(before) @ knobs, atol=1e-9)


def test_inner_parts_follow_the_nearest_boundary(kit: Kit) -> None:
    """A row of five between two ends: one stays while the other moves away."""
    names = ["post", *["knob"] * 5, "post"]
    types = np.array([[part_type.name for part_type in kit.types].index(name) for name in names], dtype=np.int16)
    poses = np.stack([pose(2.0 * place, 0, 0) for place in range(7)])
    edges = np.array([[place, place + 1] for place in range(6)], dtype=np.int32)
    graph = ordered_graph(types, [[near for near in (at - 1, at + 1) if 0 <= near < 7] for at in range(7)])
    giver, away = Side(Assembly(types, poses, edges), graph), poses.copy()
    away[6, 0, 3] += 3.0
    base, piece = Side(Assembly(types, away, edges), graph), np.arange(7) % 6 > 0
    rows = np.stack([cut(giver, piece)] * 2, axis=1)
    shifts = deform(kit, base, giver, rows, piece)[:, 0, 3]
    assert shifts[0] == pytest.approx(0.0, abs=1e-9)
    assert shifts[2] == pytest.approx(1.5, abs=0.1)
    assert shifts[4] == pytest.approx(3.0, abs=1e-9)
    assert (np.diff(shifts) > 0).all()


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_rigidly_moved_boundary_moves_all_parts_alike(kit: Kit, turns: int) -> None:
    assembly = kit.exemplars[1].assembly
    motion = pose(3.0, 0.5, -1.0, turns)
    giver, base = side(kit, assembly), side(kit, Assembly(assembly.types, motion @ assembly.poses, assembly.edges))
    piece = named(kit, assembly, "knob")
    motions = deform(kit, base, giver, np.stack([cut(giver, piece)] * 2, axis=1), piece)
    np.testing.assert_allclose(motions, np.tile(motion, (2, 1, 1)), atol=1e-9)


def test_cut_with_other_angles_is_rejected(kit: Kit) -> None:
    """Posts are no place for what goes next to them, nor is a straight piece one for a corner."""
    assembly = kit.exemplars[1].assembly
    giver, piece = side(kit, assembly), named(kit, assembly, "knob")
    rows = np.stack([cut(giver, piece), cut(giver, piece)], axis=1)
    assert is_oriented_alike(kit, giver, giver, rows)
    lowered = assembly.poses.copy()
    lowered[piece, :3, 3] += [1.0, -2.0, 0.0]
    assert not is_oriented_alike(kit, side(kit, Assembly(assembly.types, lowered, assembly.edges)), giver, rows)


def found_in(kit: Kit, *, bends: bool) -> tuple[Search, list[Variant]]:
    config = {"method": "substructures", "matching": "centroid", "deform": bends}
    line = Search(ContactOracle(kit), SearchConfig.model_validate(config))
    return line, line.run(np.random.default_rng(0), 400, 10**9, "test", lambda count: None)[0]


def test_only_deformed_pieces_fit_posts_at_another_distance(kit: Kit) -> None:
    line, rigid = found_in(kit, bends=False)
    _, bent = found_in(kit, bends=True)
    assert not rigid
    assert line.rejects["replaced: no embedding"]
    near = [entry for entry in bent if named(kit, entry.assembly, "knob").sum() == 2]
    assert near
    assert all(neighbour.lineage["deformed"] for neighbour in near)
    contact = ContactTest(kit.types, kit.contact_tolerance)
    for neighbour in near:
        posts = neighbour.assembly.poses[named(kit, neighbour.assembly, "post"), 0, 3]
        assert np.ptp(posts) == pytest.approx(4.0)
        np.testing.assert_array_equal(
            contact.contacts(neighbour.assembly.types, neighbour.assembly.poses), neighbour.assembly.edges
        )
