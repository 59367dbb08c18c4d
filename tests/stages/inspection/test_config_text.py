"""The config that inspect writes."""

from __future__ import annotations

import pytest
import yaml

from stages.inspection.config_text import config_text, proportions_section, variations_section
from tests.toy_kits.chains_and_rings import ROAD, config_of, models_of, ring


@pytest.mark.parametrize(("copied", "labels"), [(0.9, ("side", "4")), (1.0, ())])
def test_requirements_are_written_with_their_reasons(copied: float, labels: tuple[str, ...]) -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    require = {"require.max_copied_share": copied, "require.stable": True, "require.labels": labels}
    reasons = {"require.max_copied_share": "because", "require.stable": "some fall"}
    section = variations_section(config_of(shapes), reasons, require, None)
    text = config_text("toy", config_of(shapes), models_of(ROAD, shapes), reasons, section, "hundreds")
    written = {"max_copied_share": copied, "stable": True, "labels": list(labels)}
    assert yaml.safe_load(text)["variations"]["require"] == written
    assert f"max_copied_share: {copied}   # because" in text
    assert "stable: true   # some fall" in text


def test_names_that_yaml_could_misread_survive() -> None:
    shapes = [ring(1, 1), ring(2, 3)]
    label_map = {"no": ("yes", "12", "leg*"), "3: top": ("null",)}
    config = config_of(shapes).model_copy(update={"types": "meaning", "label_map": label_map})
    text = config_text("toy", config, models_of(ROAD, shapes), {}, variations_section(config, {}, {}, None), "hundreds")
    (kit,) = yaml.safe_load(text)["exemplars"]["kits"]
    assert kit["label_map"] == {name: list(patterns) for name, patterns in label_map.items()}


@pytest.mark.parametrize("has_rows", [False, True])
def test_config_of_resized_exemplars_asks_for_no_layouts_and_says_why(has_rows: bool) -> None:
    shapes = [ring(1, 1)]
    lines = proportions_section(90, True, "it does", "nothing: every part is its own type", has_rows)
    text = config_text("toy", config_of(shapes), models_of(ROAD, shapes), {}, lines, "hundreds")
    refused = config_text("toy", config_of(shapes), models_of(ROAD, shapes), {}, lines, "nothing", is_refused=True)
    assert ("ready for `make dataset" in text, "ready for" in refused) == (True, False)
    written = yaml.safe_load(text)
    assert written["variations"] == {"samples_per_kit": 0, **({"rows": {"use": True}} if has_rows else {})}
    assert written["proportions"] == {"samples_per_kit": 90, "require": {"stable": True}}
    assert "samples_per_kit: 0   # other layouts: nothing: every part is its own type" in text
