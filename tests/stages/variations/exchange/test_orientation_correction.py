"""Local correction of parts that look the wrong way."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.variations.exchange.orientation_correction import correct_orientations
from stages.variations.search.draft import load_shape
from stages.variations.search.search import Search
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import ROAD, kit_of, pose, ring


def loaded() -> Search:
    """A search whose workspace holds the ring of its first exemplar."""
    line = Search(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])), SearchConfig())
    shape = line.parents.exemplars[0]
    load_shape(line.maker.ws, shape)
    ws, n = line.maker.ws, len(shape.assembly)
    ws.rotations[:n], ws.translations[:n] = shape.assembly.poses[:, :3, :3], shape.assembly.poses[:, :3, 3]
    return line


def test_turned_part_is_turned_back() -> None:
    line = loaded()
    ws, before = line.maker.ws, line.parents.exemplars[0].assembly.poses
    for part in range(8):
        ws.rotations[part] = before[part, :3, :3] @ pose(0, 0, 0, 2)[:3, :3]
        assert correct_orientations(line.oracle.dockings, ws)
        assert np.allclose(ws.rotations[part], before[part, :3, :3], atol=1e-6)
    labels = line.parents.exemplars[0].labels
    edges = line.parents.exemplars[0].assembly.edges
    assert np.array_equal(ws.label[edges[:, 0], edges[:, 1]], labels[:, 0])


def test_correct_shape_is_left_unchanged() -> None:
    line = loaded()
    before = line.maker.ws.rotations[:8].copy()
    assert correct_orientations(line.oracle.dockings, line.maker.ws)
    assert np.array_equal(line.maker.ws.rotations[:8], before)


def test_displaced_part_cannot_be_corrected() -> None:
    line = loaded()
    line.maker.ws.translations[3] += [0.2, 0.0, 0.0]
    assert not correct_orientations(line.oracle.dockings, line.maker.ws)
