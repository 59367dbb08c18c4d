"""Images of dockings as points: which are written, and which is nearest."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.images import distinct_images, nearest_image


def _points(*places: float) -> np.ndarray:
    vectors = np.zeros((len(places), 12))
    vectors[:, 0] = places
    return vectors


def test_equal_images_are_written_once_and_near_ones_of_one_docking_share_the_lower_label():
    labels = np.array([1, 0, 0, 2, 5], dtype=np.int32)
    kept = distinct_images(_points(0.5, 0.0, 0.001, 0.4, 9.0), labels, 1.0, 0.01)
    assert kept.tolist() == [1, 0, 3, 4]  # by label; 2 equals 1
    assert labels[kept].tolist() == [0, 0, 2, 5]  # 0 is near 1, of the same docking; 3 is of another


def test_stored_images_are_distinct_and_cover_all_images():
    rng = np.random.default_rng(0)
    vectors = np.repeat(rng.normal(size=(60, 12)), 5, axis=0) + 1e-4 * rng.normal(size=(300, 12))
    kept = distinct_images(vectors, np.zeros(300, dtype=np.int32), 0.5, 0.05)
    gaps = np.linalg.norm(vectors[:, None] - vectors[kept][None], axis=2)
    assert len(kept) == 60
    assert (gaps.min(axis=1) <= 0.05).all()


def test_nearest_image_is_the_one_of_the_least_distance():
    rng = np.random.default_rng(1)
    known, asked = rng.normal(size=(50, 12)), rng.normal(size=(20, 12))
    gaps = np.linalg.norm(asked[:, None] - known[None], axis=2)
    places, found = nearest_image(known, asked)
    assert (places == gaps.argmin(axis=1)).all()
    np.testing.assert_allclose(found, gaps.min(axis=1))
