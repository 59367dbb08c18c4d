"""Near-duplicates are found at any position and quarter turn."""

from __future__ import annotations

import numpy as np

from eval.dataset.near_duplicates import (
    aligned_distance,
    near_duplicates,
    near_duplicates_table,
    nearest_by_split,
    nearest_in_train,
)


def boxes(rng: np.random.Generator, *boxes: tuple[float, ...]) -> np.ndarray:
    """Return a cloud of 1,024 points on the faces of boxes (x, y, z, width, height, depth), equally many on each."""
    count = 1024 // len(boxes)
    clouds = []
    for x, y, z, *sides in boxes:
        points = rng.random((count, 3))
        axis = rng.integers(0, 3, count)
        points[np.arange(count), axis] = rng.integers(0, 2, count)
        clouds.append(points * sides + (x, y, z))
    return np.concatenate(clouds)


L_SHAPE = ((0.0, 0.0, 0.0, 2.0, 1.0, 1.0), (0.0, 1.0, 0.0, 1.0, 1.0, 1.0))
TOWER = ((0.0, 0.0, 0.0, 1.0, 1.0, 1.0), (0.0, 1.0, 0.0, 1.0, 1.0, 1.0), (0.0, 2.0, 0.0, 1.0, 1.0, 1.0))
LOW_BOX = ((0.0, 0.0, 0.0, 3.0, 1.0, 1.0),)


def test_turned_and_moved_copy_is_near_duplicate() -> None:
    rng = np.random.default_rng(0)
    quarter = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    train = [boxes(rng, *TOWER), boxes(rng, *L_SHAPE) @ quarter.T + 5.0]
    pairs = [(boxes(rng, *shape), boxes(rng, *shape)) for shape in (L_SHAPE, LOW_BOX)]
    found = nearest_in_train(pairs, train)
    assert near_duplicates(found).tolist() == [True, False]
    assert found[0].index == 1
    assert 0.8 < found[0].distance < 1.2
    assert found[1].distance > 2.0


def test_alignment_follows_common_part_rather_than_centroids() -> None:
    rng = np.random.default_rng(1)
    apart = (12.0, 0.0, 0.0, 1.0, 1.0, 1.0)
    first, second = boxes(rng, *TOWER, *TOWER, apart), boxes(rng, *TOWER, *TOWER, TOWER[0])
    centred = abs(first.mean(axis=0) - second.mean(axis=0)).max()
    assert centred > 1.0
    assert aligned_distance(first - first.mean(axis=0), second - second.mean(axis=0), 3) < 1.0


def test_table_counts_near_duplicates_of_validation_and_test() -> None:
    rng = np.random.default_rng(2)

    def pairs(*shapes: tuple[tuple[float, ...], ...]) -> list[tuple[np.ndarray, np.ndarray]]:
        return [(boxes(rng, *shape), boxes(rng, *shape)) for shape in shapes]

    clouds = {
        ("towers", "train"): pairs(L_SHAPE, TOWER),
        ("towers", "val"): pairs(LOW_BOX),
        ("towers", "test"): pairs(L_SHAPE, LOW_BOX),
    }
    table = near_duplicates_table(nearest_by_split(clouds))
    assert [row[:5] for row in table.rows] == [("towers", "val", 1, 0, 0.0), ("towers", "test", 2, 1, 50.0)]
