"""Sweeps along eased rails do not fold."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import circle, mesh_defects, polyline, sweep
from stages.programs.library.rails import eased


def test_gentle_rail_is_unchanged() -> None:
    t = np.linspace(0.0, 1.0, 12)
    rail = np.column_stack([np.sin(t), np.cos(t), 0.0 * t])
    np.testing.assert_array_equal(eased(rail, np.full(12, 0.1)), rail)


def test_tight_bend_is_eased_until_its_sweep_does_not_fold() -> None:
    t = np.linspace(-1.0, 1.0, 17)
    rail = np.column_stack([0.3 - t * t * 0.3, 0.05 * np.tanh(8.0 * t), 0.0 * t])
    girth = 0.04
    assert mesh_defects(sweep(polyline(rail), circle(girth, 12)))
    moved = eased(rail, np.full(17, girth))
    np.testing.assert_array_equal(moved[[0, -1]], rail[[0, -1]])
    assert not mesh_defects(sweep(polyline(moved), circle(girth, 12)))
