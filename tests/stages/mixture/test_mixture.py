"""A dataset of several producers: whole, verified, with one list of classes; a config says that it is a mixture."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
import yaml

from pipeline.paths import DatasetPaths
from pipeline.shards import bytes_array, read_shard
from stages.mixture.contrast import TIPS_OVER, UNSUPPORTED
from stages.package.standalone_verifier import DatasetFindings, ShardJob, contrast_faults, record_faults
from stages.shape.collection.classes import labels_of_kits
from stages.shape.collection.discovery import languages
from stages.verification.samples import read_packaged, sample_faults
from tests.command import shapemill
from tests.stated import stated

STOOL, RACK = "tests.stages.programs.stool", "tests.stages.programs.rack"
FORT = stated({"name": "fort", "shapes": ["datasets/exemplars/playground/fort.glb"]})
SECTIONS: dict[str, Any] = {
    "mixture": {"enabled": True, "shards": {"shards": 2}, "max_samples": {"furniture": 9}, "contrast": True},
    "validity": {"falls": True},
    "exemplars": {"kits": [FORT]},
    "variations": {"samples_per_kit": 6, "splits": {"by": "graph", "shards": 1, "val": 0.2, "test": 0.2}},
    "proportions": {"samples_per_kit": 6, "parallel_searches": 1, "splits": {"shards": 1, "val": 0.2, "test": 0.2}},
    "programs": {
        "entries": [{"program": name, "mode": "random", "random": {"samples": 8}} for name in (STOOL, RACK)],
        "splits": {"shards": 1},
    },
    "shapeassembly": {
        "programs": [{"name": "furniture", "path": "datasets/exemplars/programs"}],
        "splits": {"shards": 1, "val": 0.2, "test": 0.2},
    },
    "structure": {"hierarchy": True},
    "points": {"uniform": 64},
    # A pennant seen from its edge is .4 of these pixels wide, and gets no line.
    "sketches": {"size": 48, "renderer": "raster", "views": [{"name": "front"}]},
    "package": {"previewed": 4},
}

pytestmark = pytest.mark.slow


def config_of(folder: Path, sections: dict[str, Any]) -> tuple[str, ...]:
    path = folder / "mix.yaml"
    path.write_text(yaml.safe_dump({"name": "mix", "seed": 5, "license": "MIT", **sections}), encoding="utf-8")
    return "--config", str(path), "--out", str(folder / "out")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[str, ...]]:
    folder = tmp_path_factory.mktemp("mix")
    arguments = config_of(folder, SECTIONS)
    code, printed = shapemill("run", *arguments)
    assert code == 0, printed
    return folder / "out", arguments


def records_of(out: Path) -> list[tuple[dict[str, Any], dict[str, bytes]]]:
    paths = sorted((out / "mix" / "data").rglob("*.tar"))
    return [(json.loads(members["json"]), members) for path in paths for _, members in read_shard(path)]


def test_samples_of_all_producers_are_mixed_and_counted(made: tuple[Path, tuple[str, ...]]) -> None:
    manifest = json.loads((made[0] / "mix" / "manifest.json").read_text(encoding="utf-8"))
    records = [record for record, _ in records_of(made[0])]
    counts = Counter(record["producer"] for record in records)
    assert counts == manifest["producers"]
    assert counts["programs"] == 16
    assert 0 < counts["shapeassembly"] <= 9
    assert set(counts) == {"variations", "proportions", "programs", "shapeassembly", "mixture"}
    train = [set(shard["kits"]) for shard in manifest["shards"] if shard["split"] == "train"]
    assert all(len(kits) > 2 for kits in train)
    card = (made[0] / "mix" / "README.md").read_text(encoding="utf-8")
    code, status = shapemill("status", *made[1])
    assert code == 0
    for (producer, kit), count in Counter((record["producer"], record["kit"]) for record in records).items():
        assert re.search(rf"\| {re.escape(kit)} by {producer}[^|]*\| {count} \|", card)
        assert producer == "mixture" or f"{producer}: {kit}: {count} samples" in status


def test_a_part_has_the_class_of_its_dataset_and_of_its_kit(made: tuple[Path, tuple[str, ...]]) -> None:
    rows = json.loads((made[0] / "mix" / "classes.json").read_text(encoding="utf-8"))
    own = {(kit, number): row for row in rows for kit, number in row["own"].items()}
    for record, members in records_of(made[0]):
        for part in record["parts"]:
            row = own[record["kit"], part["own_class"]]
            assert (row["id"], row["name"]) == (part["class"], part["label"])
        labels = bytes_array(members["labels.npy"])
        classes = np.array([part["class"] for part in record["parts"]])
        assert (classes[bytes_array(members["instances.npy"])] == labels).all()


def test_all_samples_have_the_same_members_and_fields(made: tuple[Path, tuple[str, ...]]) -> None:
    records = records_of(made[0])
    assert len({tuple(members) for _, members in records}) == 1
    assert len({tuple(sorted(record)) for record, _ in records}) == 1
    assert len({tuple(sorted(record["lineage"])) for record, _ in records}) == 1
    keys = {record["key"]: record["split"] for record, _ in records}
    for record, _ in records:
        json.loads(record["lineage"]["details"])
        if record["producer"] == "variations":
            parents = [parent for parent in record["lineage"]["parents"] if parent in keys]
            assert all(keys[parent] == record["split"] for parent in parents)


def test_both_verifiers_find_no_fault(made: tuple[Path, tuple[str, ...]]) -> None:
    code, printed = shapemill("verify", *made[1], "--samples", "12")
    assert code == 0, printed
    command = [sys.executable, str(made[0] / "mix" / "verify.py"), "--samples", "4"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_pairs_are_in_one_split_and_the_index_names_them(made: tuple[Path, tuple[str, ...]]) -> None:
    records = {record["key"]: record for record, _ in records_of(made[0])}
    rows = pyarrow.parquet.read_table(made[0] / "mix-index/mix.parquet").to_pylist()
    assert {row["key"] for row in rows} == set(records)
    pairs = nested = 0
    for row in rows:
        record = records[row["key"]]
        contrast = record["lineage"]["contrast"]
        assert (row["contrast"], row["partner"]) == (contrast["role"], contrast["partner"])
        assert contrast["role"] == "alone" or row["falls"] == (contrast["role"] == "falls")
        if contrast["role"] == "falls":
            partner = records[contrast["partner"]]
            assert partner["split"] == record["split"]
            assert record["lineage"]["parents"] == [partner["key"]]
            assert (record["producer"], record["lineage"]["method"]) == ("mixture", "contrast")
            if partner["language"] == "shapeassembly" and len(partner["parts"]) == len(record["parts"]):
                assert record["hierarchy"] == partner["hierarchy"]
                nested += len(record["hierarchy"]["groups"]) > 1
            pairs += 1
    assert pairs >= 20
    assert nested, "the edited shape of a hierarchical one has its hierarchy"
    card = (made[0] / "mix" / "README.md").read_text(encoding="utf-8")
    assert sum(int(line.split("|")[2]) for line in card.splitlines() if line.startswith("| a part is ")) == pairs


def test_the_standalone_verifier_sees_what_is_no_pair(made: tuple[Path, tuple[str, ...]]) -> None:
    records = [record for record, _ in records_of(made[0])]
    place = next(
        place
        for place, record in enumerate(records)
        if record["lineage"]["contrast"]["role"] == "stands" and record["lineage"]["contrast"]["edit"] != "removed"
    )
    first, second = records[place : place + 2]
    assert list(contrast_faults(first, second)) == []
    assert any("without the other" in fault for fault in contrast_faults(first, {}))
    assert any("without the other" in fault for fault in contrast_faults({}, second))

    def forged(change: Callable[[dict[str, Any], dict[str, Any]], None]) -> list[str]:
        pair = json.loads(json.dumps([first, second]))
        change(*pair)
        return list(contrast_faults(*pair))

    other = next(part for part in range(len(first["parts"])) if part != first["lineage"]["contrast"]["part"])
    turned = {UNSUPPORTED: TIPS_OVER, TIPS_OVER: UNSUPPORTED}
    own = first["lineage"]["contrast"]
    assert forged(lambda a, b: b["physics"].update(falls=False))
    assert forged(lambda a, b: a["physics"].update(falls=True))
    assert forged(lambda a, b: a["lineage"]["contrast"].update(partner="other"))
    assert forged(lambda a, b: [of["lineage"]["contrast"].update(edit="removed") for of in (a, b)])
    assert forged(lambda a, b: [of["lineage"]["contrast"].update(cause=turned[own["cause"]]) for of in (a, b)])
    assert forged(lambda a, b: b["physics"].update(fallen=b["physics"]["fallen"] + 1))
    assert forged(lambda a, b: b["parts"][other]["pose"][0].__setitem__(3, 7.0))
    assert forged(
        lambda a, b: b["parts"][b["lineage"]["contrast"]["part"]].update(pose=a["parts"][own["part"]]["pose"])
    )


def test_both_verifiers_see_a_class_that_is_not_that_of_the_kit(made: tuple[Path, tuple[str, ...]]) -> None:
    folder = made[0] / "mix"
    rows = json.loads((folder / "classes.json").read_text(encoding="utf-8"))
    names = {row["id"]: row["name"] for row in rows}
    owned = {(kit, number): row["id"] for row in rows for kit, number in row["own"].items()}
    job = ShardJob(folder, "shard", "train", [], names, owned, [], set(), (0, 0))
    rebuild = {name: language.rebuild(DatasetPaths(made[0], "mix")) for name, language in languages().items()}
    sections = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["config"]
    seen = set()
    for record, members in records_of(made[0]):
        if record["producer"] in seen:
            continue
        seen.add(record["producer"])
        forged = json.loads(members["json"])
        forged["parts"][0]["own_class"] += 1
        for said, wrong in ((record, False), (forged, True)):
            alone = list(record_faults(job, said, members, {}, DatasetFindings()))
            sample = read_packaged(said["key"], said, members, rebuild, sections, labels_of_kits(rows))
            assert any("classes.json" in fault for fault in alone) == wrong
            assert any("in its kit" in fault for fault in sample_faults(sample)) == wrong
    assert seen == {"variations", "proportions", "programs", "shapeassembly", "mixture"}


def test_several_producers_without_a_mixture_are_refused(tmp_path: Path) -> None:
    sections = {name: section for name, section in SECTIONS.items() if name != "mixture"}
    code, printed = shapemill("run", "programs", *config_of(tmp_path, sections))
    assert code == 2
    assert "mixture: true" in printed


def test_programs_of_two_modes_and_a_program_twice_are_refused(tmp_path: Path) -> None:
    for entries, reason in (
        ([{"program": STOOL}, {"program": RACK, "mode": "random"}], "one mode"),
        ([{"program": STOOL}, {"program": STOOL}], "one program"),
    ):
        code, printed = shapemill("run", "programs", *config_of(tmp_path, {"programs": entries}))
        assert code == 2
        assert reason in printed


def test_a_maximum_of_an_unknown_kit_is_refused_and_one_producer_may_be_mixed_alone(tmp_path: Path) -> None:
    programs = {"entries": [{"program": RACK, "mode": "random", "random": {"samples": 6}}], "splits": {"shards": 1}}
    for max_samples, done in (({"rock": 3}, False), ({RACK: 3}, True)):
        sections = {"programs": programs, "mixture": {"enabled": True, "max_samples": max_samples}}
        config = config_of(tmp_path, sections)
        assert shapemill("run", "programs", *config)[0] == 0
        code, printed = shapemill("run", "mixture", *config)
        assert (code == 0) == done
        assert done or "max_samples: there are no samples of rock; it may name tests.stages.programs.rack" in printed
