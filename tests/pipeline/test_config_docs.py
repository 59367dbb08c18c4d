"""The table of keys, written from the models of a config."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pipeline.config_docs import outdated_pages, section_table, write_config_pages
from tests.pipeline.test_config import Bakery
from tests.stages.shape.collection.absent import ABSENT_STAGES


def test_keys_of_alternative_models_name_their_kind() -> None:
    """What all kinds know stands once, before what each knows besides."""
    stage = replace(next(iter(ABSENT_STAGES.values())), config=Bakery)
    rows = [
        line.strip("| ").split(" | ")
        for line in section_table("bakery", stage.config).splitlines()
        if "`bakery." in line
    ]
    assert ["`bakery.small[]`", "list of keys below", "", "Small things"] in [
        [item.strip() for item in row] for row in rows
    ]
    assert [(row[0], row[-1]) for row in rows if row[0].startswith("`bakery.small[].")] == [
        ("`bakery.small[].kind`", "For `bun`:"),
        ("`bakery.small[].seeds`", "For `bun`: seeds on top"),
        ("`bakery.small[].kind`", "For `roll`:"),
        ("`bakery.small[].butter`", "For `roll`: whether it is buttered"),
    ]
    assert ("`bakery.loaves[].grams`", "Weight; unit: grams") in [(row[0], row[-1]) for row in rows]


def test_text_above_the_keys_is_kept(tmp_path: Path) -> None:
    stages = {"bakery": replace(next(iter(ABSENT_STAGES.values())), config=Bakery)}
    (tmp_path / "bakery.md").write_text("# Section `bakery`\n\nBread.\n\n## Keys\n\nold\n", encoding="utf-8")
    assert outdated_pages(tmp_path, stages) == ["dataset", "bakery"]
    write_config_pages(tmp_path, stages)
    text = (tmp_path / "bakery.md").read_text(encoding="utf-8")
    assert text.startswith("# Section `bakery`\n\nBread.\n\n## Keys\n\n| key |")
    assert "old" not in text
    assert outdated_pages(tmp_path, stages) == []
