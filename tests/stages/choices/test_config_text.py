"""The config that inspect writes."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from stages.choices.config_text import config_text
from tests.stages.variations.toy import ROAD, config_of, models_of, ring


@pytest.mark.parametrize(
    ("layouts", "telling", "required"),
    [
        (None, 0.6, {"copied": 0.9}),
        (None, 0.1, None),  # the search would refuse nearly all it finds
        (50, 0.6, None),  # there are too few to choose from
    ],
)
def test_near_copies_are_refused_where_enough_is_left(
    layouts: int | None, telling: float, required: dict[str, Any] | None
) -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    text = config_text("toy", config_of(shapes), models_of(ROAD, shapes), {}, layouts, telling, "hundreds")
    assert yaml.safe_load(text)["variations"].get("require") == required
