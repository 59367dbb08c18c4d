"""A mistake in a config is reported before any work: file, line, key, what is wrong, what would be right."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field, model_validator

from pipeline.config import Config, ExistingFile, StrictModel, load_config
from pipeline.errors import ConfigError


class Oven(StrictModel):
    heat: float = Field(220.0, ge=50, le=300, description="heat of the oven; unit: degrees Celsius")
    shelves: tuple[int, ...] = Field((1,), description="shelves in use")
    mode: Literal["fan", "grill"] = "fan"


class Loaf(StrictModel):
    flour: str = Field(description="kind of flour")
    grams: int = Field(500, gt=0, lt=5000, description="weight; unit: grams")


class Bun(StrictModel):
    kind: Literal["bun"]
    seeds: int = Field(3, ge=0, description="seeds on top")


class Roll(StrictModel):
    kind: Literal["roll"]
    butter: bool = Field(True, description="whether it is buttered")


class Named(StrictModel):
    name: str
    size: int


class Bakery(StrictModel):
    loaves: list[Loaf] = Field(default_factory=list, description="what is baked")
    recipe: ExistingFile | None = None
    named: tuple[Named, ...] = Field((), description="things with names")
    small: tuple[Annotated[Bun | Roll, Field(discriminator="kind")], ...] = Field((), description="small things")

    @model_validator(mode="after")
    def _not_too_many(self) -> Bakery:
        if len(self.loaves) > 3:
            raise ValueError(f"{len(self.loaves)} loaves do not fit into the oven: at most 3")
        return self


def load(folder: Path, text: str, **overrides: int) -> Config:
    path = folder / "bread.yaml"
    path.write_text(text, encoding="utf-8")
    return load_config(path, {"oven": Oven, "bakery": Bakery}, overrides)


def mistakes(folder: Path, text: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load(folder, text)
    return str(caught.value).replace(f"{folder}/", "").splitlines()


def test_sections_left_out_take_their_defaults(tmp_path: Path) -> None:
    config = load(tmp_path, "name: bread\nseed: 3\noven:\n")
    assert (config.name, config.version, config.seed, config.title) == ("bread", "1.0.0", 3, "bread")
    assert config.section(Oven) == Oven()
    assert config.section(Bakery).loaves == []


def test_override_replaces_the_value_of_the_file(tmp_path: Path) -> None:
    assert load(tmp_path, "name: bread\nseed: 3\n", seed=8).seed == 8


def test_values_keep_their_types(tmp_path: Path) -> None:
    oven = load(tmp_path, "name: bread\noven: {heat: 1.2e2, shelves: [2, 3], mode: grill}\n").section(Oven)
    assert oven == Oven(heat=120.0, shelves=(2, 3), mode="grill")


def test_exponent_without_a_point_is_a_number(tmp_path: Path) -> None:
    assert load(tmp_path, "name: bread\noven: {heat: 1e2}\n").section(Oven).heat == 100.0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("nam: bread\n", ["bread.yaml:1: nam: unknown key; did you mean name?", "bread.yaml: name: is missing (name"]),
        ("name: bread\noven:\n  haet: 7\n", ["bread.yaml:3: oven.haet: unknown key; did you mean heat?"]),
        ("name: bread\nzzz: 1\n", ["bread.yaml:2: zzz: unknown key; known keys are name, version, seed"]),
        (
            "name: bread\noven:\n  heat: 900\n",
            ["bread.yaml:3: oven.heat: must be at least 50 and at most 300, and is 900 (heat of the oven; unit"],
        ),
        (
            "name: bread\noven:\n  heat: .nan\n",
            ["bread.yaml:3: oven.heat: must be a finite number, and is NaN"],
        ),
        (
            "name: bread\noven:\n  heat: warm\n",
            ['bread.yaml:3: oven.heat: must be a number, and is "warm"'],
        ),
        ("name: bread\noven:\n  heat: '120'\n", ["bread.yaml:3: oven.heat: must be a number, and is"]),
        ("name: bread\noven: {mode: gril}\n", ["bread.yaml:2: oven.mode: must be 'fan' or 'grill', and is"]),
        ("name: bread\noven: {heat: müßig}\n", ['bread.yaml:2: oven.heat: must be a number, and is "müßig"']),
        (
            "name: bread\nbakery: {named: [{name: rye, size: x}, tall]}\n",
            [
                "bread.yaml:2: bakery.named[rye].size: must be a whole number, and is",
                "bread.yaml:2: bakery.named[tall]: must be keys and values, and is",
            ],
        ),
        ("name: bread\noven: 7\n", ["bread.yaml:2: oven: must be keys and values, and is 7"]),
        (
            "name: bread\nbakery:\n  loaves:\n    - flour: rye\n    - grams: 6000\n",
            [
                "bread.yaml:5: bakery.loaves[item 2].flour: is missing (kind of flour)",
                "bread.yaml:5: bakery.loaves[item 2].grams: must be above 0 and below 5000, and is 6000 (weight; unit",
            ],
        ),
        (
            "name: bread\nbakery:\n  loaves: [{flour: a}, {flour: b}, {flour: c}, {flour: d}]\n",
            ["bread.yaml:2: bakery: 4 loaves do not fit into the oven: at most 3"],
        ),
        (
            "name: bread\nbakery:\n  small:\n    - {kind: bun, sedes: 4}\n    - {butter: true}\n    - {kind: pie}\n"
            "    - {kind: roll}\n    - {kind: bun, seeds: -1}\n",
            [
                "bread.yaml:4: bakery.small[item 1].sedes: unknown key; did you mean seeds?",
                "bread.yaml:5: bakery.small[item 2]: kind is missing; it is one of bun, roll",
                "bread.yaml:6: bakery.small[item 3]: kind is pie; it is one of bun, roll",
                "bread.yaml:8: bakery.small[item 5].seeds: must be at least 0, and is -1 (seeds on top)",
            ],
        ),
        ("name: White Bread\n", ['bread.yaml:1: name: must have another form than "White Bread" (name of the']),
        (
            "name: bread\nversion: '1.0'\n",
            ['bread.yaml:2: version: must have another form than "1.0" (version, as major'],
        ),
        ("name: bread\nseed: -1\n", ["bread.yaml:2: seed: must be at least 0 and below "]),
        ("name: bread\nname: toast\n", ["bread.yaml:2: key name is defined twice; first in line 1"]),
        (
            "name: bread\noven:\n  heat: 60\n  heat: 70\n",
            ["bread.yaml:4: key oven.heat is defined twice; first in line 3"],
        ),
        ("name: bread\n7: x\n", ["bread.yaml:2: key '7' must be text: put it in quotes"]),
        ("name: [bread\n", ["bread.yaml:2: is no YAML: "]),
        ("name: bread\n\toven: 7\n", ["bread.yaml:2: is no YAML: found character '\\t' that cannot start any token"]),
        ("- bread\n", ["bread.yaml: must hold keys and values, one `key: value` a line"]),
        ("", ["bread.yaml: must hold keys and values, one `key: value` a line"]),
    ],
)
def test_mistake_names_file_line_key_and_the_right_thing(tmp_path: Path, text: str, expected: list[str]) -> None:
    reported = mistakes(tmp_path, text)
    assert len(reported) == len(expected), reported
    for line, start in zip(reported, expected, strict=True):
        assert line.startswith(start), line


def test_all_mistakes_are_reported_together(tmp_path: Path) -> None:
    assert len(mistakes(tmp_path, "name: B\nseed: x\noven: {heat: 1, mode: 2}\nbakery: {loafs: 1}\n")) == 5


def test_missing_file_names_the_nearest_existing_one(tmp_path: Path) -> None:
    (tmp_path / "sourdough.txt").write_text("wait", encoding="utf-8")
    reported = mistakes(tmp_path, f"name: bread\nbakery:\n  recipe: {tmp_path}/sourdoughs.txt\n")
    assert reported == [
        "bread.yaml:3: bakery.recipe: there is no file sourdoughs.txt; the nearest file there is sourdough.txt"
    ]


def test_missing_folder_names_the_last_existing_parent(tmp_path: Path) -> None:
    (reported,) = mistakes(tmp_path, f"name: bread\nbakery:\n  recipe: {tmp_path}/a/b/c.txt\n")
    assert reported.endswith(f"there is no file a/b/c.txt; the last folder of this path that exists is {tmp_path}")


def test_folder_in_place_of_a_file_is_reported(tmp_path: Path) -> None:
    (reported,) = mistakes(tmp_path, f"name: bread\nbakery:\n  recipe: {tmp_path}\n")
    assert reported.endswith("is a folder, not a file")


def test_unreadable_config_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: cannot be read: No such file"):
        load_config(tmp_path / "none.yaml", {})
    (tmp_path / "latin.yaml").write_bytes("name: brötchen".encode("latin-1"))
    with pytest.raises(ConfigError, match=r"latin\.yaml: is no UTF-8 text"):
        load_config(tmp_path / "latin.yaml", {})


_BOMB = "a: &a [x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 8)}]\n"
    for before, name in zip("abcdefghi", "bcdefghij", strict=True)
)

HOSTILE = {
    "name: !!python/object/apply:os.getcwd []\n": "bread.yaml:1: the tag !!python/object/apply:os.getcwd is not read",
    "name: !!set {a, b}\n": "bread.yaml:1: the tag !!set is not read",
    "name: &a [*a]\n": "bread.yaml:1: *a contains itself",
    "name: bread\noven: &o\n  <<: *o\n": "bread.yaml:3: *o contains itself",
    _BOMB: "bread.yaml:6: holds more than 50,000 values by here",
    "name: " + "[" * 50_000: "bread.yaml:1: nests deeper than 40",
    "? " * 50_000: "bread.yaml:1: nests deeper than 40",
    "name: bread\x00\n": "bread.yaml: is no YAML: it holds an invalid character or number",
    'name: bread\nbakery: {recipe: "a\\0b"}\n': "bread.yaml:2: a value holds a control character",
    'name: bread\ntitle: "\\ud800"\n': "bread.yaml:2: a value holds a control character or half a character",
    f"name: {'b' * 50_000}\n": "bread.yaml:1: name: must have at most 64 characters",
    f"name: bread\nbakery: {{recipe: {'a' * 5_000}}}\n": "bread.yaml:2: bakery.recipe: aaaa",
    f"name: bread\nbakery: {{recipe: {'a/' * 5_000}}}\n": "bread.yaml:2: bakery.recipe: a/a/",
    f"name: bread\nseed: {'9' * 5_000}\n": "bread.yaml: is no YAML: it holds an invalid character or number",
    "name: bread\n" + "#" * 1_100_000: "bread.yaml: is longer than 1,000,000 characters",
    "name: bread\n? [a]\n: 1\n": "bread.yaml:2: a key must be text",
}


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_config_is_one_short_mistake(tmp_path: Path, text: str) -> None:
    (reported,) = mistakes(tmp_path, text)
    assert reported.startswith(HOSTILE[text])
    assert len(reported) < 600


@pytest.mark.parametrize("value", ["0", "[]", "''", "false"])
def test_section_of_another_type_is_no_default(tmp_path: Path, value: str) -> None:
    (reported,) = mistakes(tmp_path, f"name: bread\noven: {value}\n")
    assert reported.startswith("bread.yaml:2: oven: must be keys and values, and is ")


def test_small_aliases_are_read(tmp_path: Path) -> None:
    text = "name: bread\nbakery:\n  loaves:\n    - &rye {flour: rye}\n    - *rye\n"
    assert [loaf.flour for loaf in load(tmp_path, text).section(Bakery).loaves] == ["rye", "rye"]


def test_only_the_first_of_many_mistakes_are_reported(tmp_path: Path) -> None:
    reported = mistakes(tmp_path, "name: bread\nbakery: {small: [" + "{kind: pie}, " * 80 + "]}\n")
    assert len(reported) == 51
    assert reported[-1].endswith("and 30 more mistakes")
