"""The share of surface that two shapes have in common: known by hand, and the same as by trying every motion."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest

from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.variations.selection.shared_surface import CENTROID_TOLERANCES, PackedShapes
from tests.stages.variations.search.test_search import search
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, pose, ring


def surface(kit: Kit, name: str) -> float:
    part = kit.types[kit.type_names().index(name)]
    a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def moved(assembly: Assembly, motion: np.ndarray) -> Assembly:
    return Assembly(assembly.types, motion @ assembly.poses, assembly.edges)


def by_every_motion(kit: Kit, first: Assembly, second: Assembly) -> float:
    """The share by laying each part upon each of its type, in each of its symmetries."""
    area = np.array([surface(kit, name) for name in kit.type_names()])
    centroid = np.array([part_type.centroid for part_type in kit.types])

    def centres(assembly: Assembly) -> np.ndarray:
        turned = np.einsum("nij,nj->ni", assembly.poses[:, :3, :3], centroid[assembly.types])
        return np.asarray(turned + assembly.poses[:, :3, 3])

    own, others = centres(first), centres(second)
    is_alike = first.types[:, None] == second.types[None]
    most = 0.0
    for i, kind in enumerate(first.types.tolist()):
        symmetries = np.stack(list(kit.types[kind].symmetries)) @ invert(first.poses[i])
        motions = (second.poses[is_alike[i], None] @ symmetries).reshape(-1, 4, 4)
        motions = motions[motions[:, 1, 1] > 0.999]
        moved_there = own @ motions[:, :3, :3].transpose(0, 2, 1) + motions[:, None, :3, 3]
        gaps = np.abs(moved_there[:, :, None] - others).max(axis=3)
        meets = (is_alike & (gaps <= CENTROID_TOLERANCES * kit.pose_tolerance)).any(axis=2)
        most = max(most, float((meets @ area[first.types]).max(initial=0.0)))
    return most / max(area[first.types].sum(), area[second.types].sum())


def test_moved_copy_shares_everything() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    one = kit.exemplars[1].assembly
    shapes = PackedShapes(kit, [one, moved(one, pose(7, 2, -3, 1))], upright=True)
    assert shapes.shares(0, np.array([1]), 0.9).tolist() == [pytest.approx(1.0)]


def test_shorter_chain_shares_all_but_a_cap() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    shapes = PackedShapes(kit, [exemplar.assembly for exemplar in kit.exemplars], upright=True)
    cap, link = surface(kit, "cap"), surface(kit, "link")
    expected = (cap + 3 * link) / (2 * cap + 5 * link)
    assert shapes.shares(0, np.array([1]), 0.3).tolist() == [pytest.approx(expected)]
    assert shapes.shares(1, np.array([0]), 0.3).tolist() == [pytest.approx(expected)]
    assert shapes.shares(0, np.array([1]), expected + 0.01).tolist() == [0.0]
    assert shapes.most_shared(0, np.array([0, 1])) == pytest.approx(1.0)


def test_tipped_shape_is_no_copy_if_upright() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    one = kit.exemplars[1].assembly
    over = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    shapes = [one, moved(one, over)]
    assert PackedShapes(kit, shapes, upright=True).shares(0, np.array([1]), 0.5)[0] < 0.9
    assert PackedShapes(kit, shapes, upright=False).shares(0, np.array([1]), 0.5)[0] == pytest.approx(1.0)


def test_turned_and_drifted_copies_far_away_share_everything() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    one, rng = kit.exemplars[1].assembly, np.random.default_rng(0)
    shapes = [one]
    for x, z, angle in rng.uniform((-500, -500, 0), (500, 500, 6.3), (40, 3)).tolist():
        motion = np.eye(4)
        motion[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)
        motion[:3, 3] = x, 0.0, z
        copy = moved(one, motion)
        drift = rng.uniform(-0.4, 0.4, (len(copy), 3)) * CENTROID_TOLERANCES * kit.pose_tolerance
        copy.poses[:, :3, 3] += drift
        shapes.append(copy)
    shared = PackedShapes(kit, shapes, upright=True).shares(0, np.arange(1, len(shapes)), 0.99)
    assert shared.tolist() == [pytest.approx(1.0)] * 40


def test_shared_surface_equals_brute_force() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    _, found = search(kit, tries=1500, max_size=3.0)
    assemblies = [variant.assembly for variant in found[:12]]
    shapes = PackedShapes(kit, assemblies, upright=True)
    exact = [by_every_motion(kit, a, b) for a, b in pairwise(assemblies)]
    assert len(set(np.round(exact, 3))) > 3
    for place, share in enumerate(exact):
        assert shapes.shares(place, np.array([place + 1]), 0.0)[0] == pytest.approx(share)
        assert (shapes.shares(place, np.array([place + 1]), share + 0.01)[0]) == 0.0
    for place in range(len(assemblies)):
        others = np.delete(np.arange(len(assemblies)), place)
        assert shapes.most_shared(place, others) == pytest.approx(shapes.shares(place, others, 0.0).max())


def test_near_relatives_are_those_of_brute_force_over_a_whole_pool() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    _, found = search(kit, tries=1500, max_size=3.0)
    assemblies = [variant.assembly for variant in found[:40]]
    shapes = PackedShapes(kit, assemblies, upright=True)
    everything = np.arange(len(assemblies))
    exact = np.eye(len(assemblies))
    for i, j in combinations(range(len(assemblies)), 2):
        exact[i, j] = exact[j, i] = by_every_motion(kit, assemblies[i], assemblies[j])
    near_count = 0
    for place in range(len(assemblies)):
        for least in (0.6, 0.8, 0.9):
            decided = np.abs(exact[place] - least) > 1e-6
            near = shapes.shares(place, everything, least, least) > 0.0
            assert near[decided].tolist() == (exact[place] >= least)[decided].tolist()
            near_count += int(near.sum()) - 1
    assert near_count > 50


def test_signature_of_a_part_has_every_place_that_an_alignment_meets() -> None:
    """A part near the edge of a cell may be met from the next one, so shapes drift by up to a tolerance."""
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    one, rng = kit.exemplars[1].assembly, np.random.default_rng(1)
    shapes = [one]
    for _ in range(60):
        copy = moved(one, pose(*rng.uniform(-50, 50, 3).tolist(), int(rng.integers(4))))
        copy.poses[:, :3, 3] += rng.uniform(-0.49, 0.49, (len(copy), 3)) * CENTROID_TOLERANCES * kit.pose_tolerance
        shapes.append(copy)
    packed = PackedShapes(kit, shapes, upright=True)
    assert (packed.shares(0, np.arange(len(shapes)), 0.999) > 0.999).all()
    assert all(packed.shares(place, np.array([0]), 0.999)[0] > 0.999 for place in range(len(shapes)))


def test_bound_by_types_is_decided_as_without_compilation_where_it_equals_the_share() -> None:
    kit = kit_of(CHAIN, [chain(count) for count in range(3, 12)])
    shapes = PackedShapes(kit, [exemplar.assembly for exemplar in kit.exemplars], upright=True)
    everything = np.arange(len(shapes))
    for place in range(len(shapes)):
        bounds = shapes._bounds(place, everything)
        for least in [*bounds.tolist(), *np.nextafter(bounds, 2.0).tolist(), 0.5]:
            assert shapes._possible(place, everything, least).tolist() == np.flatnonzero(bounds >= least).tolist()
