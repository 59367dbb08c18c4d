"""Labels from the config, for models with numbered parts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from pipeline.errors import ConfigError
from stages.exemplars.label_map import apply_label_map
from stages.exemplars.model import Model
from stages.exemplars.settings import KitConfig
from tests.toy_kits.chains_and_rings import config_of
from tests.toy_kits.tables import ROUND, SQUARE, THICK, THIN, table, table_kit

LABEL_MAP = {"top": ("p0",), "leg": ("p[1-4]",)}


def numbered(model: Model, folder: str) -> Model:
    """Return a model with numbered parts and meshes without useful names."""
    parts = tuple(
        replace(part, name=f"p{number}", label=None, mesh_name=f"m{part.mesh_name}{folder}")
        for number, part in enumerate(model.parts)
    )
    return replace(model, path=Path(folder) / "model.glb", parts=parts)


ONE, TWO = numbered(table(THIN, SQUARE), "low"), numbered(table(THICK, ROUND), "high")


def named(label_map: dict[str, tuple[str, ...]], *models: Model) -> list[list[str | None]]:
    config = config_of([[] for _ in models]).model_copy(update={"types": "meaning", "label_map": label_map})
    return [[part.label for part in parts] for parts in apply_label_map(models, config)]


def test_labelled_numbered_parts_make_the_same_kit_as_named_ones() -> None:
    numbered, named_kit = table_kit(ONE, TWO, label_map=LABEL_MAP), table_kit(table(THIN, SQUARE), table(THICK, ROUND))
    assert numbered.labels == named_kit.labels == ("top", "leg")
    assert numbered.grammar.neighbourhoods == named_kit.grammar.neighbourhoods
    assert np.array_equal(*([docking.pose for docking in kit.grammar.dockings] for kit in (numbered, named_kit)))


def test_first_fitting_label_counts_and_other_parts_keep_theirs() -> None:
    assert named({"top": ("p0",), "leg": ("p*",)}, ONE) == [["top", "leg", "leg", "leg", "leg"]]
    assert named({"front": ("p1", "p2")}, table(THIN, SQUARE), ONE)[0] == ["top", "leg", "leg", "leg", "leg"]


def test_pattern_with_a_slash_is_limited_to_one_file_or_folder() -> None:
    assert named({"x": ("low/p0",)}, ONE, TWO) == [["x", *[None] * 4], [None] * 5]
    assert named({"x": ("model/p0",)}, ONE, TWO) == [["x", *[None] * 4], ["x", *[None] * 4]]


def test_patterns_match_meshes_and_labels_too() -> None:
    assert named({"x": ("mleg*",)}, ONE) == [[None, *["x"] * 4]]
    assert named({"x": ("leg",)}, table(THIN, SQUARE)) == [["top", *["x"] * 4]]


def test_pattern_without_a_match_is_refused_with_the_part_names() -> None:
    with pytest.raises(ConfigError, match=r"kit toy: label_map\.leg: .* called 'q\*'; parts are called p0, p1, .*p4$"):
        named({"top": ("p0",), "leg": ("p1", "q*")}, ONE)


def test_label_map_is_refused_if_types_go_by_congruence() -> None:
    with pytest.raises(ValidationError, match="set `types: meaning`"):
        KitConfig.model_validate({"name": "toy", "shapes": (Path(__file__),), "label_map": LABEL_MAP})
