"""The stage in the real pipeline: rounds, splits by family or graph, and the end of a search."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from pipeline.randomness import decision_rng
from stages.shape.collection.assignment import SPLITS, SplitConfig, assign_splits
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_files import load_kit
from stages.shape.sample import read_samples
from stages.variations.selection.shared_surface import PackedShapes
from tests.command import shapemill
from tests.stated import stated
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, chain, pose, ring, write_model

pytestmark = pytest.mark.slow

SEARCH = {"max_size": 2.0, "tries_per_round": 400, "patience": 1000, "min_size": 1.0}


def write_config(folder: Path, **variations: object) -> Path:
    kits = []
    for name, meshes, shapes in (("chain", CHAIN, [chain(3), chain(5)]), ("road", ROAD, [ring(1, 1), ring(2, 3)])):
        paths = [write_model(folder / f"{name}{k}.glb", meshes, shape) for k, shape in enumerate(shapes)]
        kits.append(stated({"name": name, "shapes": paths, "contact": {"kinds": ["face"]}, "parts": "nodes"}))
    config = {"name": "toy", "seed": 5, "exemplars": {"kits": kits}, "variations": variations}
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def kits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the models of all configs here, and `out` with their kits."""
    folder = tmp_path_factory.mktemp("kits")
    code, said = shapemill(
        "run", "exemplars", "--config", write_config(folder), "--out", folder / "out", "--workers", 1
    )
    assert code == 0, said
    return folder


def make(kits: Path, out: Path, workers: int, **variations: object) -> str:
    """Make variants of the kits in `out`; everything that was printed."""
    shutil.copytree(kits / "out", out)
    config = write_config(kits, **variations)
    code, said = shapemill("run", "variations", "--config", config, "--out", out, "--workers", workers)
    assert code == 0, said
    return said


def collection(folder: Path, out: str) -> list[Path]:
    return sorted((folder / out / ".work" / "toy" / "variations").glob("toy-t*.tar")) + sorted(
        (folder / out / ".work" / "toy" / "variations").glob("toy-val-*.tar")
    )


@pytest.fixture(scope="module")
def made(kits: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("toy")
    return folder, make(kits, folder / "one", 1, samples_per_kit=2000, search=SEARCH)


def test_search_of_a_finite_language_ends_with_a_reason(made: tuple[Path, str]) -> None:
    _, printed = made
    assert "chain: 8 of 2,000: no new variant in the last" in printed


def test_slow_search_ends_with_a_reason(made: tuple[Path, str]) -> None:
    _, printed = made
    (said,) = re.findall(
        r"road: \d+ of 2,000: at the pace of the last 800 tries the rest .* all ([\d,]+) so far", printed
    )
    assert int(said.replace(",", "")) >= 1000


def test_equal_graphs_are_in_one_split(made: tuple[Path, str]) -> None:
    folder, _ = made
    split_of: dict[tuple[str, str], str] = {}
    keys = set()
    for shard in collection(folder, "one"):
        for sample in read_samples(shard):
            assert sample.key not in keys
            keys.add(sample.key)
            assert sample.split in shard.name
            assert sample.graph == graph_digest(sample.assembly.types, sample.assembly.edges)
            assert split_of.setdefault((sample.kit, sample.graph), sample.split) == sample.split
            assert np.allclose(np.linalg.det(sample.assembly.poses[:, :3, :3]), 1.0)
            assert {"parents", "boundary", "transform", "name"} <= set(sample.lineage)
    assert len(keys) >= 20
    assert set(split_of.values()) == {"train", "val", "test"}


def test_parents_are_in_the_same_split_and_splits_share_little(
    made: tuple[Path, str],
) -> None:
    folder, _ = made
    samples = [sample for shard in collection(folder, "one") for sample in read_samples(shard)]
    split_of = {sample.key: sample.split for sample in samples}
    key_of = {sample.lineage["name"]: sample.key for sample in samples}
    exemplars = {f"{kit}{number}" for kit in ("chain", "road") for number in (0, 1)}
    resolved = 0
    for sample in samples:
        assert sample.lineage["parents"]
        for parent in sample.lineage["parents"]:
            assert parent in exemplars or split_of[parent] == sample.split
        for made_of in sample.lineage["made_of"]:
            resolved += made_of not in exemplars and made_of not in key_of
            if made_of in key_of:
                assert key_of[made_of] in sample.lineage["parents"]
    assert resolved, "no parent was discarded, so nothing was tested here"
    work = folder / "one" / ".work" / "toy"
    for name in ("chain", "road"):
        kit = load_kit(work / "exemplars" / f"{name}.json", work / "exemplars" / f"{name}.tar")
        own = [sample for sample in samples if sample.kit == name]
        shapes = PackedShapes(kit, [sample.assembly for sample in own], upright=True)
        for place, sample in enumerate(own):
            others = np.array([k for k, other in enumerate(own) if other.split != sample.split], dtype=np.int64)
            assert not shapes.shares(place, others, 0.8).any()


def test_split_by_graph_assigns_everything_found(kits: Path, tmp_path: Path) -> None:
    make(
        kits, tmp_path / "one", 1, samples_per_kit=2000, search=SEARCH, splits={"by": "graph", "val": 0.2, "test": 0.3}
    )
    root = tmp_path / "one" / ".work" / "toy" / "variations"
    record = json.loads((root / "records" / "toy-assignment.json").read_text(encoding="utf-8"))
    summary = record["summary"]["kits"]
    by_key = {sample.key: sample for shard in collection(tmp_path, "one") for sample in read_samples(shard)}
    every_key = []
    for kit in ("chain", "road"):
        keys = [f"{kit}-{place:06d}" for place in range(summary[kit]["pool"])]
        groups: dict[str, list[int]] = {}
        for row, key in enumerate(keys):
            groups.setdefault(by_key[key].graph, []).append(row)
        rng = decision_rng(5, "variations", f"{kit}-selection", "splits")
        expected = assign_splits(list(groups.values()), SplitConfig(val=0.2, test=0.3), rng)
        assert [by_key[key].split for key in keys] == [SPLITS[split] for split in expected]
        every_key += keys
    assert sorted(by_key) == sorted(every_key)
    assert {kit: found["discarded"] for kit, found in summary.items()} == {"chain": 0, "road": 0}


def test_variants_beyond_max_copied_share_are_rejected_and_counted(kits: Path, tmp_path: Path) -> None:
    make(kits, tmp_path / "one", 1, samples_per_kit=2000, search=SEARCH, require={"max_copied_share": 0.6})
    samples = [sample for shard in collection(tmp_path, "one") for sample in read_samples(shard)]
    assert samples
    assert max(sample.lineage["copied"]["share"] for sample in samples) <= 0.6
    records = (tmp_path / "one" / ".work" / "toy" / "variations" / "records").glob("*-lane*.json")
    assert (
        sum(
            json.loads(record.read_text(encoding="utf-8"))["rejects"].get("largest verbatim piece too large", 0)
            for record in records
        )
        > 0
    )


def test_collection_shard_records_both_files_of_its_kits(
    made: tuple[Path, str],
) -> None:
    records = sorted((made[0] / "one/.work/toy/variations/records").glob("toy-t*.json"))
    for path in records:
        read = set(json.loads(path.read_bytes())["inputs"])
        by_file = {
            file: {kit for kit in ("chain", "road") if f"exemplars/{kit}.{file}" in read} for file in ("json", "tar")
        }
        assert by_file["json"] == by_file["tar"] != set(), path.name
    assert len(records) > 2


def test_two_workers_make_the_same_bytes(made: tuple[Path, str], kits: Path) -> None:
    folder, _ = made
    make(kits, folder / "two", 2, samples_per_kit=2000, search=SEARCH)
    assert digests(folder, "one") == digests(folder, "two")


def test_two_workers_make_the_same_bytes_by_replacement(kits: Path, tmp_path: Path) -> None:
    search = {"method": "substructures", "tries_per_round": 300, "max_rounds": 2}
    for out, workers in (("one", 1), ("two", 2)):
        make(kits, tmp_path / out, workers, samples_per_kit=40, search=search)
    assert digests(tmp_path, "one") == digests(tmp_path, "two")
    methods = {sample.lineage["method"] for shard in collection(tmp_path, "one") for sample in read_samples(shard)}
    assert methods == {"rows", "substructures"}


def digests(folder: Path, out: str) -> dict[str, str]:
    """The sha256 of every file of the stage."""
    root = folder / out / ".work" / "toy" / "variations"
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(root.glob("*.*"))}


def test_only_stable_towers_with_required_label_are_kept(tmp_path: Path) -> None:
    upright = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    meshes = {**CHAIN, "storey": trimesh.creation.box((1.0, 0.3, 0.6))}
    towers = [[(name, upright @ at) for name, at in chain(links)] for links in (3, 5)]
    towers[1][3] = ("storey", towers[1][3][1])  # so that some variants have none
    paths = [write_model(tmp_path / f"tower{k}.glb", meshes, tower) for k, tower in enumerate(towers)]
    search = {"max_size": 2.0, "tries_per_round": 400, "patience": 2500, "min_size": 0.1, "max_rounds": 20}
    config = {
        "name": "toy",
        "seed": 5,
        "exemplars": {"kits": [stated({"name": "tower", "shapes": paths, "parts": "nodes"})]},
        # a tower of n links is n + 1 high and one wide: it tips at a push of 1 / (n + 1) of its weight
        "variations": {
            "samples_per_kit": 50,
            "search": search,
            "require": {"stable": True, "physics": {"push": 0.135}, "labels": ["storey"]},
        },
    }
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    for stage in ("exemplars", "variations"):
        code, printed = shapemill(
            "run", stage, "--config", tmp_path / "toy.yaml", "--out", tmp_path / "out", "--workers", 1
        )
        assert code == 0, printed
    samples = [sample for shard in collection(tmp_path, "out") for sample in read_samples(shard)]
    assert max(len(sample.assembly) - 2 for sample in samples) == 6
    kit = load_kit(*(tmp_path / "out" / ".work" / "toy" / "exemplars" / f"tower{end}" for end in (".json", ".tar")))
    (storey,) = (number for number, part_type in enumerate(kit.types) if part_type.name == "storey")
    assert all(storey in sample.assembly.types for sample in samples)
    records = "".join(
        path.read_text(encoding="utf-8") for path in (tmp_path / "out").rglob("variations/records/*lane*.json")
    )
    assert "not stable" in records
    assert "required labels missing" in records


def test_chains_without_required_hub_are_rejected(tmp_path: Path) -> None:
    meshes = {**CHAIN, "plate": trimesh.creation.box((4.5, 0.1, 3.0))}
    plate: Placed = ("plate", pose(1, -0.55, 0))  # under both caps of a chain of three links, and of no other
    paths = [
        write_model(tmp_path / "three.glb", meshes, [*chain(3), plate]),
        write_model(tmp_path / "five.glb", meshes, chain(5)),
    ]
    search = {"max_size": 2.0, "tries_per_round": 400, "patience": 2500, "min_size": 0.1, "max_rounds": 20}
    kit = {"name": "chain", "shapes": paths, "parts": "nodes", "hubs": {"types": ["plate"], "restore": True}}
    config = {
        "name": "toy",
        "seed": 5,
        "exemplars": {"kits": [stated(kit)]},
        "variations": {"samples_per_kit": 50, "search": search, "require": {"min_hubs": 1}},
    }
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    for stage in ("exemplars", "variations"):
        _, printed = shapemill(
            "run", stage, "--config", tmp_path / "toy.yaml", "--out", tmp_path / "out", "--workers", 1
        )
    assert "the search found no variant of any kit" in printed
    records = "".join(
        path.read_text(encoding="utf-8") for path in (tmp_path / "out").rglob("variations/records/*lane*.json")
    )
    assert "hubs not restored" in records


def test_hubs_that_are_not_restored_cannot_be_required(tmp_path: Path) -> None:
    model = write_model(tmp_path / "three.glb", CHAIN, chain(3))
    config = {
        "name": "toy",
        "exemplars": {"kits": [stated({"name": "chain", "shapes": [model]})]},
        "variations": {"require": {"min_hubs": 1}},
    }
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    code, printed = shapemill("run", "exemplars", "--config", tmp_path / "toy.yaml", "--out", tmp_path / "out")
    assert code == 2
    assert "kit chain restores none" in printed
    assert not (tmp_path / "out").exists()
