from __future__ import annotations

import numpy as np
import pytest

from stages.symmetry.surface.welding import WeldedSurface, weld
from tests.stages.symmetry.planted import wall


@pytest.mark.parametrize("others", [0, 1, 40])
def test_parts_of_a_welded_surface_with_other_triangles_equal_a_fresh_weld(others: int) -> None:
    rng = np.random.default_rng(others)
    near = wall(3) + rng.uniform(-1e-9, 1e-9, (len(wall(3)), 3, 3))
    first, last = rng.permutation(len(near))[: len(near) // 2].reshape(2, -1).astype(np.int32)
    # a piece shares corners with the surface, within the tolerance; one has a corner on a side, some one below all
    pieces = near[rng.integers(len(near), size=others)] + 1e-9
    pieces[:, 1] = (pieces[:, 0] + pieces[:, 1]) / 2
    pieces[: others // 4, 2] -= 9
    merged = WeldedSurface(near, 1e-6).around(first, pieces, last)
    expected = weld(np.concatenate([near[first], pieces, near[last]]), 1e-6)
    assert np.array_equal(merged[0], expected[0])
    assert np.array_equal(merged[1], expected[1])
