"""Near-twins are found wherever they stand, and what differs is none."""

from __future__ import annotations

import numpy as np

from eval.dataset.near_duplicates import (
    cloud_distance,
    near_twins,
    near_twins_table,
    nearest_by_split,
    nearest_in_train,
)


def boxes(rng: np.random.Generator, *boxes: tuple[float, ...]) -> np.ndarray:
    """A cloud of 1,024 points on the faces of boxes (x, y, z, width, height, depth), as many on each."""
    count = 1024 // len(boxes)
    clouds = []
    for x, y, z, *sides in boxes:
        points = rng.random((count, 3))
        axis = rng.integers(0, 3, count)
        points[np.arange(count), axis] = rng.integers(0, 2, count)
        clouds.append(points * sides + (x, y, z))
    return np.concatenate(clouds)


HOUSE = ((0.0, 0.0, 0.0, 2.0, 1.0, 1.0), (0.0, 1.0, 0.0, 1.0, 1.0, 1.0))
TOWER = ((0.0, 0.0, 0.0, 1.0, 1.0, 1.0), (0.0, 1.0, 0.0, 1.0, 1.0, 1.0), (0.0, 2.0, 0.0, 1.0, 1.0, 1.0))
SHED = ((0.0, 0.0, 0.0, 3.0, 1.0, 1.0),)


def test_a_house_turned_and_carried_off_is_a_twin_and_a_shed_is_none() -> None:
    rng = np.random.default_rng(0)
    quarter = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    train = [boxes(rng, *TOWER), boxes(rng, *HOUSE) @ quarter.T + 5.0]
    asked = [(boxes(rng, *shape), boxes(rng, *shape)) for shape in (HOUSE, SHED)]
    found = nearest_in_train(asked, train)
    assert near_twins(found).tolist() == [True, False]
    assert found[0].place == 1
    assert 0.8 < found[0].distance < 1.2
    assert found[1].distance > 2.0


def test_clouds_meet_where_most_of_them_is_the_same_though_their_centroids_do_not() -> None:
    rng = np.random.default_rng(1)
    apart = (12.0, 0.0, 0.0, 1.0, 1.0, 1.0)
    first, second = boxes(rng, *TOWER, *TOWER, apart), boxes(rng, *TOWER, *TOWER, TOWER[0])
    centred = abs(first.mean(axis=0) - second.mean(axis=0)).max()
    assert centred > 1.0
    assert cloud_distance(first, second) < 1.0


def test_the_table_counts_twins_of_each_split_but_train() -> None:
    rng = np.random.default_rng(2)

    def pairs(*shapes: tuple[tuple[float, ...], ...]) -> list[tuple[np.ndarray, np.ndarray]]:
        return [(boxes(rng, *shape), boxes(rng, *shape)) for shape in shapes]

    clouds = {
        ("huts", "train"): pairs(HOUSE, TOWER),
        ("huts", "val"): pairs(SHED),
        ("huts", "test"): pairs(HOUSE, SHED),
    }
    table = near_twins_table(nearest_by_split(clouds))
    assert [row[:5] for row in table.rows] == [("huts", "val", 1, 0, 0.0), ("huts", "test", 2, 1, 50.0)]
