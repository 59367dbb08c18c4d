"""Mean shift over relative poses finds what the kit's dockings say."""

from __future__ import annotations

import numpy as np
import pytest

from eval.generated.pose_clusters import clusters_of, mean_shift
from stages.strings.categories import CategorySpace
from tests.stages.strings.test_kit_strings import kit_of
from tests.stages.training.edge_categories.networks import network, space
from tests.toy_kits.chains_and_rings import pose


def test_poses_that_differ_by_a_symmetry_are_one_cluster_and_noise_is_in_it() -> None:
    half_turn = np.stack([np.eye(4), pose(0, 0, 0, 2)])
    poses = np.stack([pose(0, 0, 0), pose(0.02, 0, 0, 2), pose(1, 0, 0), pose(0, 0, 0, 1), pose(1, 0, 0.01, 2)])
    cluster, distance = mean_shift(poses, half_turn, 1.0, 0.1)
    assert cluster.tolist() == [0, 0, 1, 2, 1]
    np.testing.assert_allclose(distance, [0.01, 0.01, 0.005, 0, 0.005], atol=1e-9)
    apart, _ = mean_shift(poses, half_turn[:1], 1.0, 0.1)
    assert len(set(apart.tolist())) == 5


def test_the_mean_walks_to_where_the_poses_are() -> None:
    """Of poses in a row one each 0.06, in which a kernel of 0.1 about the first sees but two, all near the mean go."""
    poses = np.stack([pose(0.06 * step, 0, 0) for step in range(3)])
    cluster, distance = mean_shift(poses, np.eye(4)[None], 1.0, 0.1)
    assert cluster.tolist() == [0, 0, 0]
    np.testing.assert_allclose(distance, [0.06, 0, 0.06], atol=1e-9)


def test_clusters_of_networks_are_the_categories_that_they_use() -> None:
    shapes = [network(seed) for seed in range(8)]
    found = clusters_of(space(), shapes)
    used = set()
    for shape in shapes:
        for here, there in (*shape.edges.tolist(), *shape.edges[:, ::-1].tolist()):
            a, b = (int(shape.types[each]) for each in (here, there))
            place, _, _ = space().nearest(a, b, np.linalg.inv(shape.poses[here])[None] @ shape.poses[there])
            used.add((a, b, int(place[0])))
    assert found.used == found.found == found.pure == len(used)
    assert found.known == sum(len(pair.poses) for pair in space().pairs.values())
    assert found.edges == 2 * sum(len(shape.edges) for shape in shapes)
    assert found.spread < 0.01


@pytest.mark.parametrize("name", ["castle", "playground", "space-base", "temple"])
def test_clusters_of_the_exemplars_are_categories_one_to_one(name: str) -> None:
    kit = kit_of(name)
    found = clusters_of(CategorySpace(kit), [each.assembly for each in kit.exemplars])
    assert found.used == found.found == found.pure <= found.known
    assert found.spread <= 1.0
