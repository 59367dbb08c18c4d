"""Pages lead where they say, and their Python examples run."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pipeline.shards import ShardWriter, array_bytes, json_bytes
from stages.package.glb import glb_bytes
from stages.shape.shape import kit_shape
from stages.shape.views.portrait import PAPER
from tests.stages.package.toy import chain, toy_kit

ROOT = Path(__file__).resolve().parents[1]
MAX_README_BYTES = 8_000
MAX_EXAMPLE_LINES = 9


def pages() -> list[Path]:
    """Every page that git knows or will know."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    return [ROOT / name for name in names if (ROOT / name).exists()]


def examples(page: str) -> dict[str, str]:
    """The Python blocks of a page, by the sentence before each."""
    return dict(
        re.findall(r"\n([A-Z][^\n]*):\n\n```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    )


STAGES = examples("stages/README.md")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs an example in a folder with the shipped exemplars; returns what it has defined."""
    (tmp_path / "datasets").mkdir()
    (tmp_path / "datasets/exemplars").symlink_to(ROOT / "datasets/exemplars")
    monkeypatch.chdir(tmp_path)

    def run_example(code: str) -> dict[str, Any]:
        defined: dict[str, Any] = {}
        exec(compile(code, "page", "exec"), defined)
        return defined

    return run_example


def shows_something(path: Path) -> bool:
    return float(np.mean(np.asarray(Image.open(path)) != PAPER)) > 0.05


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_local_links_of_a_page_lead_to_files(page: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    local = [link for link in links if "://" not in link and not link.startswith("mailto:")]
    assert [link for link in local if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_config_examples_of_a_page_are_valid(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pipeline.config import load_config
    from pipeline.registry import find_stages

    monkeypatch.chdir(tmp_path)
    (tmp_path / "datasets").mkdir()
    (tmp_path / "datasets/exemplars").symlink_to(ROOT / "datasets/exemplars")
    for model in ("my.glb", "other.glb", "facade.glb"):
        (tmp_path / model).touch()
    for number, example in enumerate(re.findall(r"```yaml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)):
        config = tmp_path / f"{number}.yaml"
        config.write_text(
            example if example.startswith("name:") else f"name: example\nseed: 1\n{example}", encoding="utf-8"
        )
        load_config(config, {name: stage.config for name, stage in find_stages().items()})


def config_keys() -> set[str]:
    """Every key of a config, such as `variations.search.upright`, from the generated tables."""
    tables = "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "configs/sections").glob("*.md"))
    return {key.replace("[]", "") for key in re.findall(r"(?m)^\| `([^`]+)` \|", tables)}


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_config_keys_that_a_page_names_exist(page: Path) -> None:
    keys = config_keys()
    sections = {key.partition(".")[0] for key in keys if "." in key}
    named = re.findall(r"`([a-z_]+(?:\.[a-z_]+(?:\[\])?)+)(?::[^`]*)?`", page.read_text(encoding="utf-8"))
    wanted = {name.replace("[]", "") for name in named if name.partition(".")[0] in sections}
    assert sorted(name for name in wanted - keys if not name.endswith((".npy", ".py"))) == []


def test_readme_is_one_short_page() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= MAX_README_BYTES


def test_python_examples_are_short() -> None:
    assert len(STAGES) == 6
    assert all(len(code.splitlines()) <= MAX_EXAMPLE_LINES for code in STAGES.values())


def test_chair_is_made_from_its_parameters(run: Any, tmp_path: Path) -> None:
    run(STAGES["A chair from its parameters"])
    assert shows_something(tmp_path / "chair.png")


@pytest.mark.slow
def test_kit_is_read_and_varied(run: Any) -> None:
    defined = run(STAGES["A kit read from models, and five variants of it"])
    kit, shapes = defined["kit"], defined["shapes"]
    assert len(kit.exemplars) == 2
    assert len({shape.assembly.poses.tobytes() for shape in shapes}) == 5
    exemplars = {exemplar.assembly.poses.tobytes() for exemplar in kit.exemplars}
    assert not exemplars & {shape.assembly.poses.tobytes() for shape in shapes}
    seen = {index: set(rules) for index, rules in kit.grammar.neighbourhoods.items()}
    for shape in shapes:
        types, edges = shape.assembly.types.tolist(), shape.assembly.edges.tolist()
        for part, index in enumerate(types):
            around = [types[j if i == part else i] for i, j in edges if part in (i, j)]
            assert tuple((label, around.count(label)) for label in sorted(set(around))) in seen[index]


def test_shapeassembly_program_is_executed(run: Any) -> None:
    assert len(run(STAGES["A ShapeAssembly program parsed and executed"])["shape"]) > 5


def test_finished_dataset_is_read_sample_by_sample(run: Any, tmp_path: Path) -> None:
    folder = tmp_path / "datasets/shapemill-default"
    (folder / "data/test").mkdir(parents=True)
    (folder / "manifest.json").write_bytes(json_bytes({"name": "shapemill-default", "samples": 1}))
    (folder / "classes.json").write_bytes(json_bytes([{"id": 0, "name": "block"}]))
    points, labels = np.eye(3, dtype=np.float32), np.zeros(3, np.int16)
    members = {
        "glb": glb_bytes(kit_shape(toy_kit("blocks"), chain(5, 0))),
        "points.npy": array_bytes(points),
        "normals.npy": array_bytes(points),
        "labels.npy": array_bytes(labels),
        "json": json_bytes({"physics": {"stable": True}}),
    }
    with open(folder / "data/test/a.tar", "wb") as stream, ShardWriter(stream) as writer:
        writer.write("blocks-000003", members)
    sample = run(STAGES["A finished dataset, sample by sample"])["sample"]
    assert (sample.key, sample.split, len(sample.shape), len(sample.mesh.graph.nodes_geometry)) == (
        "blocks-000003",
        "test",
        5,
        5,
    )
    assert np.array_equal(sample.points, points)
    with pytest.raises(KeyError, match=r"has no sdf\.npy; its members are glb"):
        sample.array("sdf")


def test_trained_model_is_loaded_by_the_kind_in_its_header(run: Any) -> None:
    assert type(run(STAGES["A trained model"])["model"]).__name__ == "TrainedRecovery"


@pytest.mark.slow
def test_parameters_of_a_scan_are_found(run: Any, tmp_path: Path) -> None:
    from stages import api

    shape = api.program("chair")({"scale x": 1.4})
    corners = [
        mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
        for mesh, pose in zip(shape.meshes, shape.assembly.poses, strict=True)
    ]
    cloud = np.concatenate(corners)
    np.savetxt(tmp_path / "scan.xyz", cloud[:: max(1, len(cloud) // 4000)])
    result = run(STAGES["The parameters of a scan"])["result"]
    assert result.program.name == "chair"
    assert result.distance <= result.base_distance
