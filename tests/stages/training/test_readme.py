"""The Python examples of the room's README run on models with random weights."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import stages.training
from stages.training.checkpoint import checkpoint_bytes
from stages.training.load import KINDS, load_model
from stages.training.loop import TrainState, train
from stages.training.program_lm.training import new_model as new_program_lm
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.training import ProgramVaeTask
from stages.training.program_vae.training import new_model as new_program_vae
from tests.stages.training.edge_categories.networks import kit, random_model
from tests.stages.training.program_lm.test_sampling import ENTRY, MAX_WORDS, VALUES
from tests.stages.training.program_vae.test_decoding import PROGRAMS as PROGRAM_CORPUS
from tests.stages.training.string_vae.models import random_vae, toy_strings

README = Path(stages.training.__file__).with_name("README.md").read_text(encoding="utf-8")
VAE = ProgramVaeConfig(
    name="vae", kind="program_vae", latent=8, hidden=48, kl_weight=0.0, batch_size=2, steps=250, max_rounds=1,
    learning_rate=3e-3,
)  # fmt: skip


def write_model(folder: str, module: Any, header: dict[str, Any]) -> None:
    path = Path("datasets") / folder / "weights.safetensors"
    path.parent.mkdir(parents=True)
    path.write_bytes(checkpoint_bytes(module.state_dict(), header))


SAMPLING, PROGRAMS, VOTING, FINE_TUNING = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def run(example: str, **names: Any) -> dict[str, Any]:
    exec(compile(example, "README.md", "exec"), names)
    return names


def test_examples_sample_strings_and_vote_on_placements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    strings, placer = random_vae("masked"), random_model()
    write_model("shapemill-default-models/masked-castle-0", strings.module, {**strings.header, "kind": "string_vae"})
    write_model("shapemill-default-models/walker-castle-0", placer.module, dict(placer.header))
    corpus = tmp_path / "datasets/shapemill-default-corpus/castle-train.txt"
    corpus.parent.mkdir()
    corpus.write_text("\n".join(toy_strings()), encoding="utf-8")
    defined = run(SAMPLING)
    assert defined["strings"]
    voted = run(VOTING, **{**defined, "kit": kit(), "strings": ["A0B(C)BA0"]})
    assert isinstance(voted["votes"], list)


@pytest.mark.slow
def test_example_samples_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("stages.training.program_vae.trained.PROGRAMS_PER_BATCH", 4)
    settings = {"exclude": {"name", "kits"}, "mode": "json"}
    vae = ProgramVaeTask(new_program_vae(VAE, 0), {}, VAE, PROGRAM_CORPUS, PROGRAM_CORPUS)
    train(TrainState.of(vae), np.random.default_rng(0), lambda done, total: None)
    with torch.no_grad():
        vae.validate(torch.Generator())
    write_model(
        "furniture-models/vae-furniture-0",
        vae.module,
        {"kind": "program_vae", "settings": VAE.model_dump(**settings)},
    )
    header = {"kind": "program_lm", "settings": ENTRY.model_dump(**settings), "unit": 1.2, "longest": MAX_WORDS}
    write_model("furniture-models/words-furniture-0", new_program_lm(ENTRY, VALUES, MAX_WORDS, 0), header)
    few = PROGRAMS.replace("sample(20,", "sample(1,")
    defined = run(few, load_model=load_model, Path=Path, np=np)
    assert len(defined["programs"]) == 2
    assert defined["attempts"] >= 1


def test_example_takes_a_step_from_the_shipped_encoder() -> None:
    rng = torch.Generator().manual_seed(0)
    clouds, labels = torch.rand((2, 64, 3), generator=rng) - 0.5, torch.randint(0, 6, (2, 64), generator=rng)
    defined = run(FINE_TUNING, load_model=load_model, Path=Path, clouds=clouds, labels=labels)
    before = load_model(Path("datasets/exemplars/models/encoder-pretraining")).module
    changed = defined["network"][0].embedding.weight - before.embedding.weight
    assert 0 < changed.abs().max() <= 1.1e-3, "a step of Adam"


def test_table_of_kinds_is_complete() -> None:
    table = README.partition("## Kinds of models")[2].partition("\n\n[1]")[0]
    assert set(re.findall(r"(?m)^\| `(\w+)`", table)) == set(KINDS)
