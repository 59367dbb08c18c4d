"""Mean shift over relative poses finds the dockings of the kit."""

from __future__ import annotations

import numpy as np
import pytest

from eval.generated.pose_clusters import cluster_poses, mean_shift
from stages.strings.categories import CategorySpace
from tests.stages.strings.test_kit_strings import kit_of
from tests.stages.training.edge_categories.networks import network, space
from tests.toy_kits.chains_and_rings import pose


def test_symmetric_and_noisy_poses_are_one_cluster() -> None:
    half_turn = np.stack([np.eye(4), pose(0, 0, 0, 2)])
    poses = np.stack([pose(0, 0, 0), pose(0.02, 0, 0, 2), pose(1, 0, 0), pose(0, 0, 0, 1), pose(1, 0, 0.01, 2)])
    cluster, distance = mean_shift(poses, half_turn, 1.0, 0.1)
    assert cluster.tolist() == [0, 0, 1, 2, 1]
    np.testing.assert_allclose(distance, [0.01, 0.01, 0.005, 0, 0.005], atol=1e-9)
    apart, _ = mean_shift(poses, half_turn[:1], 1.0, 0.1)
    assert len(set(apart.tolist())) == 5


def test_mean_moves_to_the_centre_of_the_poses() -> None:
    """A kernel of 0.1 around the first of three poses at steps of 0.06 covers two, but all three around their mean."""
    poses = np.stack([pose(0.06 * step, 0, 0) for step in range(3)])
    cluster, distance = mean_shift(poses, np.eye(4)[None], 1.0, 0.1)
    assert cluster.tolist() == [0, 0, 0]
    np.testing.assert_allclose(distance, [0.06, 0, 0.06], atol=1e-9)


def test_clusters_of_networks_are_their_categories() -> None:
    shapes = [network(seed) for seed in range(8)]
    found = cluster_poses(space(), shapes)
    used = set()
    for shape in shapes:
        for here, there in (*shape.edges.tolist(), *shape.edges[:, ::-1].tolist()):
            a, b = (int(shape.types[part]) for part in (here, there))
            nearest, _, _ = space().nearest(a, b, np.linalg.inv(shape.poses[here])[None] @ shape.poses[there])
            used.add((a, b, int(nearest[0])))
    assert found.used == found.clusters == found.pure == len(used)
    assert found.known == sum(len(pair.poses) for pair in space().pairs.values())
    assert found.edges == 2 * sum(len(shape.edges) for shape in shapes)
    assert found.max_distance < 0.01


@pytest.mark.parametrize("name", ["castle", "playground", "space-base", "temple"])
def test_clusters_of_exemplars_are_categories_one_to_one(name: str) -> None:
    kit = kit_of(name)
    found = cluster_poses(CategorySpace(kit), [exemplar.assembly for exemplar in kit.exemplars])
    assert found.used == found.clusters == found.pure <= found.known
    assert found.max_distance <= 1.0
