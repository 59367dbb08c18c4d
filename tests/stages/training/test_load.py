"""Training in the real pipeline: programs of a dataset to published weights."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from stages.shape.sample import read_samples
from stages.shapeassembly import parse
from stages.training.checkpoint import CheckpointError
from stages.training.program_lm.trained import load_program_lm
from stages.training.program_vae.trained import load_program_vae
from tests.command import shapemill

EXAMPLES = sorted(Path("datasets/exemplars/programs").glob("*.txt"))


@pytest.mark.slow
def test_models_of_programs_are_trained_loaded_and_sampled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "programs").mkdir()
    for path in EXAMPLES:
        for number in range(2):
            text = path.read_text(encoding="utf-8").replace(
                "0.5, 0.0, 0.5, 0.5, 1.0, 0.5", f"0.5, 0.0, 0.5, 0.5, 1.0, 0.5{number}"
            )
            (tmp_path / "programs" / f"{path.stem}-{number}.txt").write_text(text, encoding="utf-8")
    model = {
        "name": "tiny",
        "kind": "program_vae",
        "latent": 8,
        "hidden": 32,
        "batch_size": 4,
        "learning_rate": 0.01,  # with less it rejects nearly all that it samples, which takes longer than learning
        "steps": 60,
        "max_rounds": 2,
    }
    flat = {**model, "name": "flat", "ablate": "hierarchy"}
    cuboids = {"name": "cuboids", "kind": "cuboid_rnn", "hidden": 32, "batch_size": 4, "steps": 60, "max_rounds": 2}
    parts = {
        "name": "parts",
        "kind": "part_graph_vae",
        "latent": 8,
        "hidden": 32,
        "batch_size": 4,
        "steps": 60,
        "max_rounds": 2,
    }
    words = {
        "name": "words",
        "kind": "program_lm",
        "width": 16,
        "layers": 1,
        "batch_size": 4,
        "steps": 20,
        "max_rounds": 2,
    }
    sections = {
        "shapeassembly": {
            "programs": [{"name": "furniture", "path": str(tmp_path / "programs")}],
            "splits": {"shards": 1, "val": 0.2, "test": 0.2},
        },
        "training": {"max_length": 1000, "models": [model, flat, cuboids, parts, words]},
    }
    config = tmp_path / "toy.yaml"
    config.write_text(yaml.safe_dump({"name": "toy", "seed": 5, **sections}), encoding="utf-8")
    out = tmp_path / "out"
    for stage in ("shapeassembly", "training"):
        code, printed = shapemill("run", stage, "--config", config, "--out", out, "--workers", 1)
        assert code == 0, printed
    counts = json.loads((out / ".work/toy/training/furniture-program_vae.json").read_text(encoding="utf-8"))["counts"]
    assert counts["train"]["programs"] >= 5
    flattened = json.loads(
        (out / ".work/toy/training/furniture-program_vae-hierarchy.json").read_text(encoding="utf-8")
    )["counts"]
    assert flattened["train"]["assemblies"] == flattened["train"]["programs"]
    assert counts["train"]["assemblies"] > counts["train"]["programs"]
    trained = load_program_vae(out / "toy-models/tiny-furniture-0/weights.safetensors", {"kit": "furniture"})
    points = trained.encode([parse(path.read_text(encoding="utf-8")) for path in EXAMPLES[:3]])
    assert points.shape == (3, 8)
    train = [
        parse(sample.text) for sample in read_samples(next((out / ".work/toy/shapeassembly").glob("toy-train-*.tar")))
    ]
    codes, drawn = trained.encode(train), trained.sample_points(20_000, np.random.default_rng(0))
    assert np.allclose(drawn.mean(axis=0), codes.mean(axis=0), atol=0.05 * drawn.std())
    noise = np.linalg.eigvalsh(np.cov(drawn.T) - np.cov(codes.T, bias=True))
    assert noise.min() > -0.05 * drawn.var(), "they spread further than the means, by what encoding leaves open"
    again = [trained.decode(points, reject=False) for _ in range(2)]
    assert again[0] == again[1]
    assert np.isfinite(points).all()
    language = load_program_lm(out / "toy-models/words-furniture-0/weights.safetensors", {"kit": "furniture"})
    found = [language.sample(1, np.random.default_rng(seed))[0] for seed in (0, 0, 1)]
    assert found[0] == found[1] != found[2]
    with pytest.raises(CheckpointError, match="another kit"):
        load_program_lm(out / "toy-models/words-furniture-0/weights.safetensors", {"kit": "chair"})
    for size in ("stages.training.program_vae.trained.PROGRAMS_PER_BATCH", "eval.programs.quality.DECODE_BATCH_SIZE"):
        monkeypatch.setattr(size, 8)
    settings = [f"--set={option}" for option in ("samples=2", "sequences=1", "steps=4")]
    code, printed = shapemill("eval", "shapeassembly", "--config", config, "--out", out, *settings)
    assert code == 0, printed
    table = (out / "toy-eval/shapeassembly.md").read_text(encoding="utf-8")
    assert all(
        row in table
        for row in (
            "| tiny-furniture-0 |",
            "| tiny-furniture-0, no reject |",
            "| flat-furniture-0, without hierarchy |",
            "| words-furniture-0 |",
            "| cuboids-furniture-0 |",
            "| parts-furniture-0 |",
            "furniture, val",
            "storage, ShapeAssembly",
            "chair, no macros",
        )
    )
    for name, workers in {"tiny": (1, 2), "words": (1,)}.items():
        (tmp_path / name).mkdir()
        check_sampled_dataset(tmp_path / name, out, name, workers)


def check_sampled_dataset(folder: Path, out: Path, model: str, asked: tuple[int, ...]) -> None:
    """What a model writes becomes samples, the same ones however they are shared out among shards and workers."""
    source = {"name": "stool", "dataset": "toy", "model": model, "kit": "furniture", "samples": 3}
    sections = {
        "shapeassembly": {"sampled": [source], "max_overflow": 100, "splits": {"shards": 1}},
        "program_sampling": {"programs_per_shard": 2},
    }
    config = folder / "sampled.yaml"
    config.write_text(yaml.safe_dump({"name": "sampled", "seed": 5, **sections}), encoding="utf-8")
    found = []
    for workers in asked:
        made = folder / f"out{workers}"
        shutil.copytree(out / "toy-models", made / "toy-models")
        for stage in ("program_sampling", "shapeassembly"):
            code, printed = shapemill("run", stage, "--config", config, "--out", made, "--workers", workers)
            assert code == 0, printed
        work = made / ".work/sampled"
        written = [
            json.loads(line)
            for path in sorted((work / "program_sampling").glob("*.jsonl"))
            for line in path.open(encoding="utf-8")
        ]
        assert [row["name"] for row in written] == [f"toy-models/{model}-furniture-0/{n:06d}" for n in range(3)]
        texts = {row["name"]: row["text"] for row in written}
        samples = [sample for path in sorted((work / "shapeassembly").glob("*.tar")) for sample in read_samples(path)]
        assert samples
        assert all(texts[sample.lineage["parents"][0]] == sample.text for sample in samples)
        found.append([(sample.key, sample.split, sample.text) for sample in samples])
    assert all(item == found[0] for item in found)
