"""String sampling on the real pipeline: chains of links from a model's weights to a verified dataset."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from eval.engine.dataset_run import load_dataset_run
from eval.engine.registry import read_tables
from pipeline.paths import DatasetPaths, file_digest
from stages.exemplars.language import dataset_kits
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Kit
from stages.shape.sample import Sample, read_samples
from stages.strings.compiled_grammar import compile_grammar, patterns_json
from stages.strings.decoder import decode
from stages.strings.tokens import make_alphabet
from tests.command import shapemill
from tests.pipeline.conftest import made
from tests.stages.string_sampling.trained_model import publish_model
from tests.stated import stated
from tests.toy_kits.chains_and_rings import CHAIN, chain, write_model

pytestmark = pytest.mark.slow

SOURCE = {"dataset": "parent", "model": "tiny", "kit": "chain", "samples": 8, "sampling": "prior", "temperature": 1.0}
"""A model trained on one string, whose Gaussian would be a point."""
STAGES = ("autoconfig", "exemplars", "variations", "programs", "shapeassembly", "string_sampling")
FINISHING = ("validity", "strings", "points", "sketches", "package")


def write_config(folder: Path, samples_per_kit: int = 0, **string_sampling: Any) -> Path:
    """Write the config of a dataset of generated chains; the exemplars have two links and three."""
    paths = [write_model(folder / f"chain{links}.glb", CHAIN, chain(links)) for links in (2, 3)]
    kit = stated({"name": "chain", "shapes": paths, "contact": {"kinds": ["face"]}, "parts": "nodes"})
    settings = {"sources": [SOURCE], "draws": 24, "parallel_searches": 2, "splits": {"shards": 1}, **string_sampling}
    config = {
        "name": "sampled",
        "seed": 3,
        "license": "MIT",
        "exemplars": {"kits": [kit]},
        "variations": {"samples_per_kit": samples_per_kit},
        "string_sampling": settings,
        "points": {"uniform": 64},
        "sketches": {"size": 64, "renderer": "raster", "views": [{"name": "front"}]},
        "package": {"previewed": 4},
    }
    path = folder / "sampled.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
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
    return dataset_kits(DatasetPaths(out, "sampled"))["chain"]


def samples(out: Path) -> list[Sample]:
    root = DatasetPaths(out, "sampled").stage("string_sampling").root
    return [sample for path in sorted(root.glob("sampled-*-0*.tar")) for sample in read_samples(path)]


@pytest.fixture(scope="module")
def sampled(bare: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Sample from a model trained on a chain of four links; return the folder and all that was printed."""
    folder = with_kit(bare, tmp_path_factory.mktemp("sampled"))
    publish_model(folder, "parent", kit_in(folder), [string_of(4)])
    code, said = run(bare / "sampled.yaml", folder, *STAGES[2:])
    assert code == 0, said
    return folder, said


def test_shapes_are_new_distinct_and_have_a_lineage(sampled: tuple[Path, str]) -> None:
    folder, said = sampled
    found, alphabet = samples(folder), make_alphabet(kit_in(folder).labels)
    assert len(found) == 8
    assert len({sample.graph for sample in found}) == len({sample.key for sample in found}) == 8
    assert not {string_of(links) for links in (2, 3, 4)} & {sample.lineage["string"] for sample in found}
    weights = file_digest(folder / "parent-models/tiny-chain-0/weights.safetensors")
    for sample in found:
        decoded = decode(sample.lineage["string"], alphabet)
        assert graph_digest(decoded.types, decoded.edges) == sample.graph
        assert sample.lineage["novelty"] == "new"
        assert sample.lineage["weights"] == weights
        assert sample.lineage["model"] == "parent/tiny-chain-0"
        assert sample.lineage["placements"] >= len(sample.assembly)
    assert "all shapes found" in said


def test_rejects_are_counted_by_reason(sampled: tuple[Path, str]) -> None:
    records = DatasetPaths(sampled[0], "sampled").stage("string_sampling").records
    workers = [json.loads(path.read_bytes()) for path in sorted(records.glob("s00-*-worker*.json"))]
    refused = {reason for worker in workers for reason in worker["rejects"]}
    assert {"known: train", "duplicate"} <= refused
    for worker in workers:
        assert worker["summary"]["found"] + sum(worker["rejects"].values()) == worker["summary"]["drawn"]


def test_bytes_do_not_depend_on_workers(sampled: tuple[Path, str], bare: Path, tmp_path: Path) -> None:
    publish_model(with_kit(bare, tmp_path), "parent", kit_in(tmp_path), [string_of(4)])
    assert run(bare / "sampled.yaml", tmp_path, *STAGES[2:], workers=2)[0] == 0
    one, two = (made(folder / ".work/sampled/string_sampling") for folder in (sampled[0], tmp_path))
    assert one == two


def test_known_shapes_can_be_kept_and_are_marked(bare: Path, tmp_path: Path) -> None:
    config = write_config(tmp_path, duplicates="keep", max_rounds=2)
    kit = dataset_kits(DatasetPaths(bare, "sampled"))["chain"]
    publish_model(tmp_path, "parent", kit, [string_of(4)])
    assert run(config, tmp_path, *STAGES)[0] == 0
    marks = {sample.graph: sample.lineage["novelty"] for sample in samples(tmp_path)}
    decoded = {links: decode(string_of(links), make_alphabet(kit.labels)) for links in (2, 3, 4)}
    graphs = {links: graph_digest(chain.types, chain.edges) for links, chain in decoded.items()}
    assert marks[graphs[4]] == "train"
    assert {marks.get(graphs[links], "exemplar") for links in (2, 3)} == {"exemplar"}
    assert "new" in marks.values()


def test_generated_shapes_become_a_verified_dataset(sampled: tuple[Path, str], bare: Path) -> None:
    folder, config = sampled[0], bare / "sampled.yaml"
    code, said = run(config, folder, *FINISHING)
    assert code == 0, said
    code, said = shapemill("verify", "--config", config, "--out", folder, "--samples", "all")
    assert code == 0, said
    card = (folder / "sampled/README.md").read_text(encoding="utf-8")
    assert "models trained on the strings of other shapes generate new strings" in card
    assert "parent/tiny-chain-0 prior" in card


def test_table_compares_generated_and_training_shapes(sampled: tuple[Path, str], bare: Path) -> None:
    folder, table = sampled[0], read_tables()[0]["generated"]
    assert run(bare / "sampled.yaml", folder, *FINISHING)[0] == 0
    dataset = load_dataset_run(bare / "sampled.yaml", folder)
    assert "no finished dataset parent" in table.missing(dataset)
    for root in (folder, folder / ".work"):  # as if they were the training shapes
        shutil.copytree(root / "sampled", root / "parent")
    assert table.missing(dataset) == ""
    result = table.compute(dataset, table.options.model_validate({"max_shapes": 100}))
    rows = [dict(zip(result.tables[0].columns, row, strict=True)) for row in result.tables[0].rows]
    assert [(row["shapes of"], row["shapes"]) for row in rows][1] == ("chain, generated", 8)
    assert rows[0]["shapes of"] == "chain, training"
    assert [row.title for row in result.image_rows] == ["chain, training", "chain, generated"]


def test_missing_model_is_reported_with_the_command_that_trains_it(bare: Path) -> None:
    code, said = run(bare / "sampled.yaml", bare, "string_sampling")
    assert code == 2
    assert "string_sampling.sources[item 1]" in said
    assert "parent-models/tiny-chain-0/weights.safetensors" in said
    assert "make train" in said


def rejected(bare: Path, folder: Path, changed: dict[str, Any], content: bytes = b"") -> str:
    """Return what is printed for a model with a changed header, or with other bytes."""
    path = publish_model(with_kit(bare, folder), "parent", kit_in(folder), [string_of(4)], changed)
    if content:
        path.write_bytes(content)
    code, said = run(bare / "sampled.yaml", folder, *STAGES[2:])
    assert code != 0
    return said


def test_weights_of_another_kit_are_rejected(bare: Path, tmp_path: Path) -> None:
    assert "is of another names" in rejected(bare, tmp_path, {"names": ["cap", "wheel"]})


def test_weights_of_another_grammar_are_rejected(bare: Path, tmp_path: Path) -> None:
    kit = kit_in(bare)
    patterns = patterns_json(compile_grammar(kit.grammar, len(kit.labels), 1))
    other = {**patterns, "size": [size + 1 for size in patterns["size"]]}
    assert "another grammar" in rejected(bare, tmp_path, {"patterns": other})


def test_pickle_instead_of_weights_is_rejected(bare: Path, tmp_path: Path) -> None:
    assert "is a pickle" in rejected(bare, tmp_path, {}, b"\x80\x04K\x01.")


def test_variations_and_string_sampling_are_exclusive(tmp_path: Path) -> None:
    code, said = run(write_config(tmp_path, samples_per_kit=5), tmp_path, "string_sampling")
    assert code == 2
    assert "variations.samples_per_kit: 0" in said


@pytest.mark.parametrize("dataset", ["../elsewhere", "/etc", ".work", "a/b"])
def test_models_outside_the_output_folder_are_rejected(tmp_path: Path, dataset: str) -> None:
    code, said = run(write_config(tmp_path, sources=[{**SOURCE, "dataset": dataset}]), tmp_path, "string_sampling")
    assert code == 2
    assert "string_sampling.sources[item 1].dataset" in said
