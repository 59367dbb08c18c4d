from __future__ import annotations

import numpy as np
import pytest

from stages.symmetry.matching.cell_lookup import items_in, items_moved_into
from stages.symmetry.surface.grid import SurfaceGrid, surface_grid
from tests.stages.symmetry.planted import screw, wall


@pytest.fixture(scope="module")
def three_windows() -> SurfaceGrid:
    return surface_grid(wall(3), 0.03)


class TestItems:
    def test_items_of_cells_are_those_with_these_cells(self, three_windows: SurfaceGrid) -> None:
        cells = np.arange(5, len(three_windows), 7)
        expected = np.flatnonzero(np.isin(three_windows.item_cell, cells))
        assert np.array_equal(items_in(three_windows, cells), expected)
        assert not len(items_in(three_windows, cells[:0]))

    @pytest.mark.parametrize("pose", [screw(0.0, 0.0), screw(0.0, 1.0), screw(0.7, 0.31), screw(3.1, -0.4)])
    def test_items_moved_into_cells_are_those_whose_inverse_lies_in_the_cells(
        self, three_windows: SurfaceGrid, pose: np.ndarray
    ) -> None:
        grid = three_windows
        cells = np.flatnonzero(grid.cells[:, 0] < np.median(grid.cells[:, 0])).astype(np.int32)
        back = (grid.points - pose[:3, 3]) @ pose[:3, :3]
        home = np.floor((back - grid.origin) / grid.cell_size).astype(np.int64)
        wanted = {tuple(cell) for cell in grid.cells[cells].tolist()}
        expected = [item for item, cell in enumerate(home.tolist()) if tuple(cell) in wanted]
        assert items_moved_into(grid, cells, pose).tolist() == expected
        assert not len(items_moved_into(grid, cells[:0], pose))
