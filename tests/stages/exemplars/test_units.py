"""The unit of model files: stated by the format or by the config; shapes are made in metres where it is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stages.exemplars.build import observe_models, read_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, KitConfig, Units
from stages.package.card import unit_sentence
from stages.package.sources import SourceTally
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import Kit
from stages.shape.kit_files import load_kit, write_kit
from stages.shape.shape import kit_shape, upright
from tests.stages.exemplars.model_files import box, write_obj
from tests.stages.model_files.one_table import SIZE, write_one_table


def kit_of(*paths: Path, units: Units = "auto") -> Kit:
    return read_kit(KitConfig(name="table", shapes=paths, units=units).resolve(STRICTEST))


def size_of(kit: Kit) -> list[float]:
    low, high = shape_bounds(kit_shape(kit, kit.exemplars[0].assembly))
    return (high - low).tolist()


def test_formats_state_their_unit_or_none(tmp_path: Path) -> None:
    for path in write_one_table(tmp_path):
        stated = path.suffix in (".glb", ".gltf", ".dae")
        assert read_parts(path, "components" if path.suffix in (".ply", ".stl", ".off") else "auto").unit == (
            1.0 if stated else None
        )


@pytest.mark.parametrize(("units", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), ("ft", 0.3048)])
def test_stated_unit_scales_the_kit_to_metres(units: Units, metres: float, tmp_path: Path) -> None:
    parts = {"low": box((1200, 400, 800)), "high": box((600, 300, 500), (100, 400, 100))}
    kit = kit_of(write_obj(tmp_path / "chest.obj", parts), units=units)
    assert kit.unit == "metre"
    np.testing.assert_allclose(size_of(kit), np.array([1200, 700, 800]) * metres)
    assert kit.contact_tolerance == pytest.approx(metres * kit_of(tmp_path / "chest.obj").contact_tolerance)


def test_unit_goes_from_file_to_shape_and_card(tmp_path: Path) -> None:
    files = {path.name: path for path in write_one_table(tmp_path)}
    metric, unknown = kit_of(files["plain.glb"]), kit_of(files["negative.obj"])
    assert (metric.unit, unknown.unit) == ("metre", "unknown")
    np.testing.assert_allclose(size_of(metric), SIZE, atol=1e-6)
    with (tmp_path / "kit.json").open("wb") as text, (tmp_path / "kit.tar").open("wb") as arrays:
        write_kit(metric, text, arrays)
    loaded = load_kit(tmp_path / "kit.json", tmp_path / "kit.tar")
    assert upright(kit_shape(loaded, loaded.exemplars[0].assembly)).unit == "metre"
    tallies = {name: SourceTally() for name in ("table", "chest")}
    assert "The unit is unknown" in unit_sentence(tallies)
    tallies["table"].unit = "metre"
    assert "the metre for table, and unknown for the others" in unit_sentence(tallies)
    tallies["chest"].unit = "metre"
    assert unit_sentence(tallies) == "The unit is the metre."


def test_files_with_and_without_a_unit_are_named(tmp_path: Path) -> None:
    files = {path.name: path for path in write_one_table(tmp_path)}
    config = KitConfig(name="table", shapes=(files["plain.glb"], files["negative.obj"])).resolve(STRICTEST)
    observed = observe_models(config, [read_parts(shape.path) for shape in config.shapes])
    assert observed.kit.unit == "unknown"
    assert any("no unit is known for negative.obj" in warning for warning in observed.warnings)
