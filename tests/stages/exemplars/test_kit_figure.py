"""The figure of a kit shows its part types, however thin, and of thousands the commonest."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from stages.exemplars.kit_figure import kit_figure
from tests.toy_kits.chains_and_rings import CHAIN, chain, kit_of

SLIVER = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-7, 0.0]]


def test_part_type_that_no_camera_sees_is_an_empty_cell() -> None:
    kit = kit_of(CHAIN, [chain(3)])
    cap = kit.types[0]
    thin = replace(cap, vertices=np.array(SLIVER), faces=np.array([[0, 1, 2]], dtype=np.int32))
    shown = replace(kit, types=(replace(thin, face_colors=cap.face_colors[:1]), *kit.types[1:]))
    picture = Image.open(BytesIO(kit_figure(shown)))
    assert picture.size == Image.open(BytesIO(kit_figure(kit))).size


def test_of_many_types_the_commonest_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    kit = kit_of(CHAIN, [chain(3)])
    monkeypatch.setattr("stages.exemplars.kit_figure.MAX_TYPES_SHOWN", len(kit.types))
    whole, many = (Image.open(BytesIO(kit_figure(replace(kit, types=kit.types * times)))) for times in (1, 9))
    assert whole.size == many.size
