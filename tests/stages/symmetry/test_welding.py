from __future__ import annotations

import numpy as np
import pytest

from stages.symmetry.surface.welding import WeldedSurface, weld
from tests.stages.symmetry.planted import wall


@pytest.mark.parametrize("others", [0, 1, 40])
def test_what_is_put_together_of_a_welded_surface_and_of_others_is_as_if_welded_anew(others: int) -> None:
    rng = np.random.default_rng(others)
    near = wall(3) + rng.uniform(-1e-9, 1e-9, (len(wall(3)), 3, 3))
    first, last = rng.permutation(len(near))[: len(near) // 2].reshape(2, -1).astype(np.int32)
    # a piece shares corners with the surface, within the tolerance; one has a corner on a side, some one below all
    pieces = near[rng.integers(len(near), size=others)] + 1e-9
    pieces[:, 1] = (pieces[:, 0] + pieces[:, 1]) / 2
    pieces[: others // 4, 2] -= 9
    had = WeldedSurface(near, 1e-6).around(first, pieces, last)
    wanted = weld(np.concatenate([near[first], pieces, near[last]]), 1e-6)
    assert np.array_equal(had[0], wanted[0])
    assert np.array_equal(had[1], wanted[1])
