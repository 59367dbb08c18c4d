"""Dreaming on the real mill: chains of links that a model wrote, from its weights to a verified dataset."""

from __future__ import annotations

import json
import shutil
from argparse import Namespace
from pathlib import Path
from typing import Any

import pytest
import yaml

from eval.engine.dataset_run import load_dataset_run
from eval.engine.registry import find_tables
from pipeline.paths import DatasetPaths, file_digest
from stages.exemplars.language import dataset_kits
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Kit
from stages.shape.sample import Sample, read_samples
from stages.strings.alphabet import make_alphabet
from stages.strings.compiled_grammar import compile_grammar, patterns_json
from stages.strings.decoder import decode
from tests.command import shapemill
from tests.pipeline.conftest import made
from tests.stages.string_sampling.trained_model import publish_model
from tests.stated import stated
from tests.toy_kits.chains_and_rings import CHAIN, chain, write_model

pytestmark = pytest.mark.slow

SOURCE = {"dataset": "learnt", "model": "tiny", "kit": "chain", "samples": 8, "way": "prior", "temperature": 1.0}
"""A model that has learnt one string: where training strings stand there is but a point."""
STAGES = ("autoconfig", "exemplars", "variations", "programs", "shapeassembly", "string_sampling")
SERVED = ("validity", "strings", "points", "sketches", "package")


def write_config(folder: Path, samples_per_kit: int = 0, **string_sampling: Any) -> Path:
    """The config of a dataset of dreamt chains; the exemplars have two links and three."""
    paths = [write_model(folder / f"chain{links}.glb", CHAIN, chain(links)) for links in (2, 3)]
    kit = stated({"name": "chain", "shapes": paths, "contact": {"kinds": ["face"]}, "parts": "nodes"})
    settings = {"sources": [SOURCE], "draws": 24, "lanes": 2, "splits": {"shards": 1}, **string_sampling}
    config = {
        "name": "dreamt",
        "seed": 3,
        "license": "MIT",
        "exemplars": {"kits": [kit]},
        "variations": {"samples_per_kit": samples_per_kit},
        "string_sampling": settings,
        "points": {"uniform": 64},
        "sketches": {"size": 64, "backend": "raster", "views": [{"name": "front"}]},
        "package": {"previewed": 4},
    }
    path = folder / "dreamt.yaml"
    path.write_text(yaml.safe_dump(config))
    return path


def run(config: Path, out: Path, *stages: str, workers: int = 1) -> tuple[int, str]:
    """Run stages until one fails; the last exit code and all that was printed."""
    printed = ""
    for stage in stages:
        code, said = shapemill("run", stage, "--config", config, "--out", out, "--workers", workers)
        printed += said
        if code:
            return code, printed
    return 0, printed


def string_of(links: int) -> str:
    return "A" + "B" * links + "A"


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the config and its kit, and no model."""
    folder = tmp_path_factory.mktemp("bare")
    code, said = run(write_config(folder), folder, *STAGES[:2])
    assert code == 0, said
    return folder


def with_kit(bare: Path, folder: Path) -> Path:
    """`folder` with the kit that was made before."""
    shutil.copytree(bare / ".work", folder / ".work", dirs_exist_ok=True)
    return folder


def kit_in(out: Path) -> Kit:
    return dataset_kits(DatasetPaths(out, "dreamt"))["chain"]


def samples(out: Path) -> list[Sample]:
    root = DatasetPaths(out, "dreamt").stage("string_sampling").root
    return [each for path in sorted(root.glob("dreamt-*-0*.tar")) for each in read_samples(path)]


@pytest.fixture(scope="module")
def dreamt(bare: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """What a model that has learnt from a chain of four links has dreamt, and all that was printed."""
    folder = with_kit(bare, tmp_path_factory.mktemp("dreamt"))
    publish_model(folder, "learnt", kit_in(folder), [string_of(4)])
    code, said = run(bare / "dreamt.yaml", folder, *STAGES[2:])
    assert code == 0, said
    return folder, said


def test_shapes_are_new_different_and_say_where_they_are_from(dreamt: tuple[Path, str]) -> None:
    folder, said = dreamt
    found, alphabet = samples(folder), make_alphabet(kit_in(folder).labels)
    assert len(found) == 8
    assert len({each.graph for each in found}) == len({each.key for each in found}) == 8
    assert not {string_of(links) for links in (2, 3, 4)} & {each.lineage["string"] for each in found}
    weights = file_digest(folder / "learnt-models/tiny-chain-0/weights.safetensors")
    for each in found:
        decoded = decode(each.lineage["string"], alphabet)
        assert graph_digest(decoded.types, decoded.edges) == each.graph
        assert each.lineage["known"] == "new"
        assert each.lineage["weights"] == weights
        assert each.lineage["model"] == "learnt/tiny-chain-0"
        assert each.lineage["tries"] >= len(each.assembly)
    assert "as many as wanted" in said


def test_what_is_refused_is_counted_by_its_reason(dreamt: tuple[Path, str]) -> None:
    records = DatasetPaths(dreamt[0], "dreamt").stage("string_sampling").records
    lanes = [json.loads(path.read_bytes()) for path in sorted(records.glob("s00-*-lane*.json"))]
    refused = {reason for lane in lanes for reason in lane["rejects"]}
    assert {"known: train", "duplicate"} <= refused
    for lane in lanes:
        assert lane["summary"]["found"] + sum(lane["rejects"].values()) == lane["summary"]["drawn"]


def test_bytes_are_the_same_with_two_workers(dreamt: tuple[Path, str], bare: Path, tmp_path: Path) -> None:
    publish_model(with_kit(bare, tmp_path), "learnt", kit_in(tmp_path), [string_of(4)])
    assert run(bare / "dreamt.yaml", tmp_path, *STAGES[2:], workers=2)[0] == 0
    one, two = (made(folder / ".work/dreamt/string_sampling") for folder in (dreamt[0], tmp_path))
    assert one == two


def test_known_shapes_are_kept_and_marked_where_they_are_asked_for(bare: Path, tmp_path: Path) -> None:
    config = write_config(tmp_path, known="keep", rounds=2)
    kit = dataset_kits(DatasetPaths(bare, "dreamt"))["chain"]
    publish_model(tmp_path, "learnt", kit, [string_of(4)])
    assert run(config, tmp_path, *STAGES)[0] == 0
    marks = {each.lineage["string"]: each.lineage["known"] for each in samples(tmp_path)}
    assert marks[string_of(4)] == "train"
    assert {marks.get(string_of(links), "exemplar") for links in (2, 3)} == {"exemplar"}
    assert "new" in marks.values()


def test_dreamt_shapes_go_the_whole_way(dreamt: tuple[Path, str], bare: Path) -> None:
    folder, config = dreamt[0], bare / "dreamt.yaml"
    code, said = run(config, folder, *SERVED)
    assert code == 0, said
    code, said = shapemill("verify", "--config", config, "--out", folder, "--samples", "all")
    assert code == 0, said
    card = (folder / "dreamt/README.md").read_text()
    assert "models that have learnt the strings of other shapes write new ones" in card
    assert "learnt/tiny-chain-0 prior" in card


def test_dreams_stand_in_a_table_beside_what_they_were_learnt_from(dreamt: tuple[Path, str], bare: Path) -> None:
    folder, table = dreamt[0], find_tables()["dreams"]
    assert run(bare / "dreamt.yaml", folder, *SERVED)[0] == 0
    subject = load_dataset_run(bare / "dreamt.yaml", folder)
    assert "no finished dataset learnt" in table.missing(subject)
    for place in (folder, folder / ".work"):  # as if they had been learnt
        shutil.copytree(place / "dreamt", place / "learnt")
    assert table.missing(subject) == ""
    answer = table.answer(subject, Namespace(dreams=100))
    rows = [dict(zip(answer.tables[0].columns, row, strict=True)) for row in answer.tables[0].rows]
    assert [(row["shapes of"], row["shapes"]) for row in rows][1] == ("chain, dreamt", 8)
    assert rows[0]["shapes of"] == "chain, learnt"
    assert [strip.title for strip in answer.strips] == ["chain, learnt", "chain, dreamt"]


def test_a_model_that_is_not_trained_is_named_with_what_trains_it(bare: Path) -> None:
    code, said = run(bare / "dreamt.yaml", bare, "string_sampling")
    assert code == 2
    assert "string_sampling.sources.0" in said
    assert "learnt-models/tiny-chain-0/weights.safetensors" in said
    assert "make train" in said


def refused(bare: Path, folder: Path, changed: dict[str, Any], content: bytes = b"") -> str:
    """What is said of a model with another header, or with other bytes in place of it."""
    path = publish_model(with_kit(bare, folder), "learnt", kit_in(folder), [string_of(4)], changed)
    if content:
        path.write_bytes(content)
    code, said = run(bare / "dreamt.yaml", folder, *STAGES[2:])
    assert code != 0
    return said


def test_weights_of_another_kit_are_refused(bare: Path, tmp_path: Path) -> None:
    assert "is of another names" in refused(bare, tmp_path, {"names": ["cap", "wheel"]})


def test_weights_of_another_grammar_are_refused(bare: Path, tmp_path: Path) -> None:
    kit = kit_in(bare)
    patterns = patterns_json(compile_grammar(kit.grammar, len(kit.labels), 1))
    other = {**patterns, "size": [each + 1 for each in patterns["size"]]}
    assert "another grammar" in refused(bare, tmp_path, {"patterns": other})


def test_a_pickle_in_place_of_weights_is_refused(bare: Path, tmp_path: Path) -> None:
    assert "is a pickle" in refused(bare, tmp_path, {}, b"\x80\x04K\x01.")


def test_variations_and_dreams_do_not_go_together(tmp_path: Path) -> None:
    code, said = run(write_config(tmp_path, samples_per_kit=5), tmp_path, "string_sampling")
    assert code == 2
    assert "variations.samples_per_kit: 0" in said


@pytest.mark.parametrize("dataset", ["../elsewhere", "/etc", ".work", "a/b"])
def test_models_outside_the_output_folder_are_refused(tmp_path: Path, dataset: str) -> None:
    code, said = run(write_config(tmp_path, sources=[{**SOURCE, "dataset": dataset}]), tmp_path, "string_sampling")
    assert code == 2
    assert "string_sampling.sources.0.dataset" in said
