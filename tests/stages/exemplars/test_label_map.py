"""Meanings by a config's word, for models whose parts are called by numbers."""

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

MEANINGS = {"top": ("p0",), "leg": ("p[1-4]",)}


def numbered(model: Model, folder: str) -> Model:
    """A model whose parts are called by numbers and whose meshes have no names that tell."""
    parts = tuple(
        replace(part, name=f"p{number}", label=None, mesh_name=f"m{part.mesh_name}{folder}")
        for number, part in enumerate(model.parts)
    )
    return replace(model, path=Path(folder) / "model.glb", parts=parts)


ONE, TWO = numbered(table(THIN, SQUARE), "low"), numbered(table(THICK, ROUND), "high")


def named(meanings: dict[str, tuple[str, ...]], *models: Model) -> list[list[str | None]]:
    config = config_of([[] for _ in models]).model_copy(update={"types": "meaning", "label_map": meanings})
    return [[part.label for part in parts] for parts in apply_label_map(models, config)]


def test_numbered_parts_make_the_kit_that_named_ones_make() -> None:
    said, told = table_kit(ONE, TWO, label_map=MEANINGS), table_kit(table(THIN, SQUARE), table(THICK, ROUND))
    assert said.labels == told.labels == ("top", "leg")
    assert said.grammar.neighbourhoods == told.grammar.neighbourhoods
    assert np.array_equal(*([each.pose for each in kit.grammar.dockings] for kit in (said, told)))


def test_the_first_meaning_that_fits_counts_and_what_none_fits_keeps_its_label() -> None:
    assert named({"top": ("p0",), "leg": ("p*",)}, ONE) == [["top", "leg", "leg", "leg", "leg"]]
    assert named({"front": ("p1", "p2")}, table(THIN, SQUARE), ONE)[0] == ["top", "leg", "leg", "leg", "leg"]


def test_a_pattern_with_a_stroke_speaks_of_one_model_by_its_file_or_folder() -> None:
    assert named({"x": ("low/p0",)}, ONE, TWO) == [["x", *[None] * 4], [None] * 5]
    assert named({"x": ("model/p0",)}, ONE, TWO) == [["x", *[None] * 4], ["x", *[None] * 4]]


def test_meshes_and_labels_are_names_too() -> None:
    assert named({"x": ("mleg*",)}, ONE) == [[None, *["x"] * 4]]
    assert named({"x": ("leg",)}, table(THIN, SQUARE)) == [["top", *["x"] * 4]]


def test_a_pattern_that_fits_nothing_is_refused_with_the_names_that_there_are() -> None:
    with pytest.raises(ConfigError, match=r"kit toy: label_map\.leg: .* called 'q\*'; parts are called p0, p1, .*p4$"):
        named({"top": ("p0",), "leg": ("p1", "q*")}, ONE)


def test_meanings_are_refused_where_types_go_by_congruence() -> None:
    with pytest.raises(ValidationError, match="set `types: meaning`"):
        KitConfig.model_validate({"name": "toy", "shapes": (Path(__file__),), "label_map": MEANINGS})
