"""The config that inspect writes."""

from __future__ import annotations

import pytest
import yaml

from stages.inspection.config_text import config_text, proportions_section, variations_section
from tests.toy_kits.chains_and_rings import ROAD, config_of, models_of, ring


@pytest.mark.parametrize(("copied", "carcass"), [(0.9, ("side", "4")), (1.0, ())])
def test_what_variants_must_be_is_typed_out_with_its_reasons(copied: float, carcass: tuple[str, ...]) -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    require = {"require.max_copied_share": copied, "require.stable": True, "require.labels": carcass}
    reasons = {"require.max_copied_share": "because", "require.stable": "some fall"}
    asked = variations_section(config_of(shapes), reasons, require, None)
    text = config_text("toy", config_of(shapes), models_of(ROAD, shapes), reasons, asked, "hundreds")
    said = {"copied": copied, "stable": True, "carcass": list(carcass)}
    assert yaml.safe_load(text)["variations"]["require"] == said
    assert f"copied: {copied}   # because" in text
    assert "stable: true   # some fall" in text


def test_names_that_yaml_reads_as_something_else_come_back_as_they_are() -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    meanings = {"no": ("yes", "12", "leg*"), "3: top": ("null",)}
    config = config_of(shapes).model_copy(update={"types": "meaning", "label_map": meanings})
    text = config_text("toy", config, models_of(ROAD, shapes), {}, variations_section(config, {}, {}, None), "hundreds")
    (kit,) = yaml.safe_load(text)["exemplars"]["kits"]
    assert kit["label_map"] == {name: list(patterns) for name, patterns in meanings.items()}


def test_a_config_of_other_proportions_varies_no_layouts_and_says_why() -> None:
    shapes = [ring(1, 1)]
    lines = proportions_section(90, True, "it does", "nothing: every part is its own type")
    text = config_text("toy", config_of(shapes), models_of(ROAD, shapes), {}, lines, "hundreds")
    said = yaml.safe_load(text)
    assert said["variations"] == {"samples_per_kit": 0}
    assert said["proportions"] == {"samples_per_kit": 90, "require": {"stable": True}}
    assert "samples_per_kit: 0   # other layouts: nothing: every part is its own type" in text
