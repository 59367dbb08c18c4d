"""The config that inspect writes."""

from __future__ import annotations

import pytest
import yaml

from stages.choices.config_text import config_text
from tests.stages.variations.toy import ROAD, config_of, models_of, ring


@pytest.mark.parametrize(("copied", "carcass"), [(0.9, ("side", "4")), (1.0, ())])
def test_what_variants_must_be_is_typed_out_with_its_reasons(copied: float, carcass: tuple[str, ...]) -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    require = {"require.copied": copied, "require.stable": True, "require.carcass": carcass}
    reasons = {"require.copied": "because", "require.stable": "some fall"}
    text = config_text("toy", config_of(shapes), models_of(ROAD, shapes), reasons, require, None, "hundreds")
    said = {"copied": copied, "stable": True, "carcass": list(carcass)}
    assert yaml.safe_load(text)["variations"]["require"] == said
    assert f"copied: {copied}   # because" in text
    assert "stable: true   # some fall" in text


def test_names_that_yaml_reads_as_something_else_come_back_as_they_are() -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    meanings = {"no": ("yes", "12", "leg*"), "3: top": ("null",)}
    config = config_of(shapes).model_copy(update={"types": "meaning", "meanings": meanings})
    text = config_text("toy", config, models_of(ROAD, shapes), {}, {}, None, "hundreds")
    (kit,) = yaml.safe_load(text)["exemplars"]["kits"]
    assert kit["meanings"] == {name: list(patterns) for name, patterns in meanings.items()}
