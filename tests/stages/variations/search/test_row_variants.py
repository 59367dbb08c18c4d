"""Exemplars with longer and shorter rows in a search: what is drawn, what follows from it, and how it is checked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.paths import DatasetPaths
from stages.exemplars.language import LANGUAGE
from stages.rows.changes import changes_text
from stages.rows.settings import RowsConfig
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.shape.kit_files import write_kit
from stages.shape.shape import kit_shape
from stages.variations.audit import AUDIT
from stages.variations.search.row_variants import RowVariants
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.settings import SearchConfig
from tests.stages.rows import models
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, ring


def row_variants(kit: Kit, wanted: int = 100) -> tuple[Search, list[Variant]]:
    search = Search(ContactOracle(kit), SearchConfig(method="exchange"))
    return search, search.with_rows(np.random.default_rng(1), RowVariants(kit, RowsConfig()), wanted, "test")


def links(variant: Variant) -> int:
    return len(variant.assembly) - 2


def test_rows_have_every_length_in_their_range() -> None:
    kit = kit_of(CHAIN, [chain(4)])
    _, found = row_variants(kit)
    assert sorted(map(links, found)) == [2, 3, 5, 6, 7, 8]
    assert all(variant.lineage["method"] == "rows" for variant in found)
    assert all(variant.lineage["parents"] == [kit.exemplars[0].name] for variant in found)
    assert [variant.number for variant in found] == list(range(len(found)))


def test_pieces_of_shapes_with_other_rows_are_exchanged() -> None:
    kit = kit_of(CHAIN, [chain(4)])
    search, known = row_variants(kit, wanted=3)
    found, _ = search.run(np.random.default_rng(2), 1500, 10**9, "test", lambda _: None, known)
    assert found[: len(known)] == known
    names = {f"test-{variant.number}" for variant in known}
    assert any(names & set(variant.lineage["parents"]) for variant in found[len(known) :])
    assert len(set(map(links, found))) == len(found)


def test_parts_that_would_become_longer_are_counted() -> None:
    kit, _ = models.shelf()
    search, found = row_variants(kit)
    assert not found
    assert search.rejects["rows: a part would become longer or shorter"] > 0


def test_a_kit_without_rows_has_no_such_variants() -> None:
    search, found = row_variants(kit_of(ROAD, [ring(1, 1)]))
    assert not found
    assert not search.rejects


@pytest.fixture
def packaged(tmp_path: Path) -> tuple[PackagedSample, DatasetPaths]:
    kit = kit_of(CHAIN, [chain(4)])
    paths = DatasetPaths(tmp_path, "toy")
    root = paths.stage("exemplars").root
    root.mkdir(parents=True)
    with (root / "toy.json").open("wb") as text, (root / "toy.tar").open("wb") as arrays:
        write_kit(kit, text, arrays)
    variant = max(row_variants(kit)[1], key=links)
    shape = kit_shape(kit, variant.assembly)
    parts = [
        {"name": name, "pose": pose.tolist()} for name, pose in zip(shape.part_names, shape.assembly.poses, strict=True)
    ]
    lineage = {**variant.lineage, "made_of": variant.lineage["parents"], "restored_hubs": 0}
    record = {"language": LANGUAGE.name, "kit": "toy", "parts": parts, "lineage": lineage}
    return PackagedSample("toy-000000", record, {}, {}, shape, {}), paths


def test_changes_made_again_give_the_sample(packaged: tuple[PackagedSample, DatasetPaths]) -> None:
    assert list(AUDIT.recheck(*packaged)) == []


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"rows": changes_text(()) + " "}, "has other parts"),
        ({"rows": "[{}]"}, "cannot be changed"),
        ({"made_of": ["unknown"]}, "no such exemplar"),
    ],
)
def test_a_lineage_that_tells_of_another_shape_is_a_fault(
    packaged: tuple[PackagedSample, DatasetPaths], changed: dict[str, Any], fault: str
) -> None:
    sample, paths = packaged
    wrong = replace(sample, record={**sample.record, "lineage": {**sample.record["lineage"], **changed}})
    (found,) = AUDIT.recheck(wrong, paths)
    assert fault in found


def test_a_moved_part_is_a_fault(packaged: tuple[PackagedSample, DatasetPaths]) -> None:
    sample, paths = packaged
    sample.record["parts"][2]["pose"][0][3] += 0.1
    assert "at other places" in next(AUDIT.recheck(sample, paths))
