"""The table of keys, written from the models of a config."""

from __future__ import annotations

from dataclasses import replace

from pipeline.config_docs import config_tables
from tests.pipeline.test_config import Bakery
from tests.stages.shape.collection.absent import ABSENT_STAGES


def test_keys_of_entries_of_several_kinds_say_whose_they_are() -> None:
    """What all kinds know stands once, before what each knows besides."""
    stage = replace(next(iter(ABSENT_STAGES.values())), config=Bakery)
    rows = [
        line.strip("| ").split(" | ") for line in config_tables({"bakery": stage}).splitlines() if "`bakery." in line
    ]
    assert ["`bakery.small[]`", "list of keys below", "", "Small things"] in [
        [each.strip() for each in row] for row in rows
    ]
    assert [(row[0], row[-1]) for row in rows if row[0].startswith("`bakery.small[].")] == [
        ("`bakery.small[].kind`", "Of `bun`:"),
        ("`bakery.small[].seeds`", "Of `bun`: seeds on top"),
        ("`bakery.small[].kind`", "Of `roll`:"),
        ("`bakery.small[].butter`", "Of `roll`: whether it is buttered"),
    ]
    assert ("`bakery.loaves[].grams`", "Weight; unit: grams") in [(row[0], row[-1]) for row in rows]
