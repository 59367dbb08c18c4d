"""The config that inspect writes."""

from __future__ import annotations

import pytest
import yaml

from stages.choices.config_text import config_text
from tests.stages.variations.toy import ROAD, config_of, models_of, ring


@pytest.mark.parametrize("copied", [0.9, 1.0])
def test_what_was_chosen_of_near_copies_is_typed_out_with_its_reason(copied: float) -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    reasons = {"require.copied": "because"}
    text = config_text("toy", config_of(shapes), models_of(ROAD, shapes), reasons, copied, None, "hundreds")
    assert yaml.safe_load(text)["variations"]["require"] == {"copied": copied}
    assert f"copied: {copied}   # because" in text


def test_names_that_yaml_reads_as_something_else_come_back_as_they_are() -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    meanings = {"no": ("yes", "12", "leg*"), "3: top": ("null",)}
    config = config_of(shapes).model_copy(update={"types": "meaning", "meanings": meanings})
    text = config_text("toy", config, models_of(ROAD, shapes), {}, 1.0, None, "hundreds")
    (kit,) = yaml.safe_load(text)["exemplars"]["kits"]
    assert kit["meanings"] == {name: list(patterns) for name, patterns in meanings.items()}
