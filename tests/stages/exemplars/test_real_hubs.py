"""Hubs and strictness on public models, and the configs that use them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.config import Config, load_config
from pipeline.registry import find_stages
from stages.exemplars.build import build_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import ExemplarsConfig, KitConfig
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.variations.requirements.hub_restoration import HubRestorer

ROOT = Path(__file__).resolve().parents[3]
EXEMPLARS = ROOT.parent / "shared" / "exemplars"
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))

needs_models = pytest.mark.skipif(not EXEMPLARS.is_dir(), reason="the public exemplars are not next to the project")


def loaded(path: Path, monkeypatch: pytest.MonkeyPatch) -> Config:
    monkeypatch.chdir(ROOT)
    stages = find_stages()
    config = load_config(path, {name: stage.config for name, stage in stages.items()})
    for stage in stages.values():
        stage.check(config)
    return config


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_config_that_comes_with_the_project_is_valid(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "../shared" in path.read_text(encoding="utf-8") and not EXEMPLARS.is_dir():
        pytest.skip("its models are not next to the project")
    own = {"default": "shapemill-default", "images": "shapemill-images", "shapeassembly": "furniture-programs"}
    assert loaded(path, monkeypatch).name == own.get(path.stem, path.stem)


def kit_of(config: KitConfig) -> Kit:
    return build_kit(config, [read_parts(shape.path, config.parts) for shape in config.shapes])[0]


@needs_models
@pytest.mark.parametrize(("name", "parts", "contacts"), [("bridge", 65, 201), ("temple", 186, 555)])
def test_real_exemplar_gets_its_hubs_back(
    name: str, parts: int, contacts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = loaded(ROOT / "configs" / f"{name}.yaml", monkeypatch)
    kit = kit_of(config.section(ExemplarsConfig).kits[0])
    whole = HubRestorer(ContactOracle(kit), upright=True).fit(kit.exemplars[0].assembly)
    assert (len(whole), len(whole.edges)) == (parts, contacts)
    contacts = ContactTest(kit.types, kit.contact_tolerance).contacts(whole.types, whole.poses)
    np.testing.assert_array_equal(whole.edges, contacts)
