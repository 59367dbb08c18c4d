"""Configs: one YAML file for each dataset, validated as a whole before any work.

A config holds facts of the dataset (`DatasetFacts`) and a section for each stage, whose model the stage declares. A
path in a config is relative to the folder in which the command runs.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import ConfigError
from pipeline.yaml_loader import KeyPath, read_yaml

MAX_MISTAKES_SHOWN = 50
MAX_CHARACTERS_SHOWN = 200
SECTION_PAGES = Path("configs", "sections")
"""Folder of the project with a page on the keys of each section."""

_TYPES_IN_WORDS = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "keys and values",
    "model_type": "keys and values",
    "path_type": "a path",
}
"""What a value should be, by the kind of pydantic's error."""

Section = TypeVar("Section", bound="StrictModel")


class StrictModel(BaseModel):
    """Base of every config section: frozen, no unknown keys, no silent conversion of types, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class DatasetFacts(StrictModel):
    """The keys of a config that belong to no stage."""

    name: str = Field(
        pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$",
        max_length=64,
        description="name of the dataset and of its folder; lower-case letters, digits and single dashes",
    )
    version: str = Field(
        "1.0.0", pattern=r"^(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)$", description="version, as major.minor.patch"
    )
    seed: int = Field(0, ge=0, lt=2**63, description="seed of all randomness; another seed makes another dataset")
    title: str = Field("", description="title on the dataset's card; the name if empty")
    description: str = Field("", description="what the dataset is, in a sentence or a few, for its card")
    license: str = Field("unknown", min_length=1, description="licence of the dataset, as an SPDX id such as CC-BY-4.0")
    keep: Literal["all", "dataset"] = Field(
        "all",
        description="what is kept when the dataset is finished: all; or the dataset alone, whose intermediates are "
        "pruned, and rebuilt on demand",
    )


@dataclass(frozen=True)
class Config:
    """A validated config: facts of the dataset, and one section for each stage."""

    name: str
    version: str
    seed: int
    sections: Mapping[str, StrictModel]
    path: Path
    title: str = ""
    description: str = ""
    license: str = "unknown"
    keep: Literal["all", "dataset"] = "all"

    def section(self, model: type[Section]) -> Section:
        """Return the section of the stage that declares the config class `model`. Raises KeyError."""
        for section in self.sections.values():
            if isinstance(section, model):
                return section
        raise KeyError(f"no stage declares {model.__name__}")

    def only(self, stages: Iterable[str]) -> Config:
        """Return this config with the sections of some stages only."""
        return replace(self, sections={name: self.sections[name] for name in stages})


def nearest_word(word: str, known: Iterable[str]) -> str | None:
    """Return the known word most similar to `word`, or None."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return matches[0] if matches else None


def existing_file(path: Path) -> Path:
    """Return `path`. Raises ValueError, with the nearest existing file, when it is no readable file."""
    try:
        if "\0" not in str(path) and path.is_file():
            return path
    except OSError as error:
        raise ValueError(f"{_shown(str(path))} is no file: {error.strerror}") from None
    if not str(path).isprintable():
        raise ValueError(f"{_shown(str(path))} is no path: it holds characters that cannot be printed")
    if path.is_dir():
        raise ValueError(f"{path} is a folder, not a file")
    folder = path.parent
    if not folder.is_dir():
        while not folder.is_dir() and folder != folder.parent:
            folder = folder.parent
        raise ValueError(f"there is no file {path}; the last folder of this path that exists is {folder.resolve()}")
    names = sorted(file.name for file in folder.iterdir() if file.is_file())
    close = nearest_word(path.name, names)
    hint = f"; the nearest file there is {folder / close}" if close else ""
    raise ValueError(f"there is no file {path}{hint}")


ExistingFile = Annotated[Path, AfterValidator(existing_file)]
"""Type of a config key that names an existing file, relative to the folder where the command runs."""


def load_config(
    path: Path, sections: Mapping[str, type[StrictModel]], overrides: Mapping[str, Any] | None = None
) -> Config:
    """Read the config in a YAML file.

    sections: model of each stage's section, by the stage's name; a missing section takes its defaults
    overrides: facts of the dataset in place of the file's, such as `{"seed": 7}`

    Raises ConfigError with one line for each mistake: file, line, key, what is wrong, what would be right.
    """
    values, lines = read_yaml(path)
    mistakes: list[str] = []
    facts = {key: value for key, value in values.items() if key in DatasetFacts.model_fields} | dict(overrides or {})
    for key in values:
        if key not in facts and key not in sections:
            known = [*DatasetFacts.model_fields, *sections]
            hint = f"{_known(key, known)}; sections are listed in configs/README.md"
            mistakes.append(f"{_where(path, lines, (key,))}: {_shown(key)}: unknown key; {hint}")
    header = _validate(path, lines, (), DatasetFacts, facts, mistakes)
    validated: dict[str, StrictModel] = {}
    for name, model in sections.items():
        given = values.get(name)
        section = _validate(path, lines, (name,), model, {} if given is None else given, mistakes)
        if section is not None:
            validated[name] = section
    if mistakes or header is None:
        beyond = len(mistakes) - MAX_MISTAKES_SHOWN
        more = [f"{path}: and {beyond:,} more mistakes"] if beyond > 0 else []
        raise ConfigError("\n".join([*mistakes[:MAX_MISTAKES_SHOWN], *more]))
    return Config(
        name=header.name,
        version=header.version,
        seed=header.seed,
        sections=validated,
        path=path,
        title=header.title or header.name,
        description=header.description,
        license=header.license,
        keep=header.keep,
    )


def _validate(
    path: Path,
    lines: Mapping[KeyPath, int],
    section_key: KeyPath,
    model: type[Section],
    values: Any,
    mistakes: list[str],
) -> Section | None:
    # Through JSON: there a strict model takes a list for a tuple and text for a path, which YAML cannot write.
    try:
        return model.model_validate_json(json.dumps(values))
    except ValidationError as error:
        prefix = ".".join(map(str, section_key))
        for location, sentence in explain_mistakes(model, error, prefix or "dataset"):
            named = key_in_words(values, location)
            key = prefix + (f".{named}" if prefix and named and named[0] != "[" else named)
            where = _where(path, lines, (*section_key, *location))
            mistakes.append(f"{where}: {_shown(key) or '(the file)'}: {sentence}")
        return None


def mistakes_in_words(model: type[BaseModel], error: ValidationError, values: Any, section: str = "") -> list[str]:
    """Return a line for each mistake in `values`, which `model` refused: the key, what is wrong, what would be right.

    section: the config section whose page lists the keys, or empty
    """
    return [
        f"{_shown(key_in_words(values, location)) or 'all'}: {sentence}"
        for location, sentence in explain_mistakes(model, error, section)
    ]


def key_in_words(values: Any, location: KeyPath) -> str:
    """Return the key at a location, such as `kits[castle].shapes[wall.glb]`.

    An item of a list has its name or path, or its number from 1.
    """
    words, here = "", values
    for step in location:
        if isinstance(step, int):
            here = here[step] if isinstance(here, list | tuple) and step < len(here) else None
            words += f"[{_item_in_words(here, step)}]"
        elif isinstance(here, Mapping) and (step in here or step not in here.values()):
            words += f".{step}" if words else step
            here = here.get(step)
        # Another step is no key: the kind of one of several models, or a key that a text stands for.
    return words


def _item_in_words(item: Any, index: int) -> str:
    if isinstance(item, Mapping):
        item = item.get("name", item.get("path"))
    return item if isinstance(item, str) and item else f"item {index + 1}"


def explain_mistakes(
    model: type[BaseModel], error: ValidationError, section: str = ""
) -> Iterator[tuple[KeyPath, str]]:
    """Yield the location of each mistake in the values that `model` refused, and what is wrong and would be right."""
    schema = model.model_json_schema()
    details = error.errors(include_url=False)
    for detail in details:
        # pydantic drops faulty items from a list and then finds it too short: not another mistake
        if detail["type"] == "too_short" and any(
            other["loc"][: len(detail["loc"])] == detail["loc"] != other["loc"] for other in details
        ):
            continue
        yield detail["loc"], _explain(schema, detail, section)


def _page_hint(section: str, shows: str = "its keys are") -> str:
    page = SECTION_PAGES / f"{section}.md"
    return f"; {shows} in {page}" if (Path(__file__).parents[1] / page).is_file() else ""


def _shown(text: str) -> str:
    """Shorten a text and replace characters that cannot be printed."""
    plain = "".join(char if char.isprintable() else "\ufffd" for char in text[:MAX_CHARACTERS_SHOWN])
    return plain if len(text) <= MAX_CHARACTERS_SHOWN else f"{plain}… ({len(text):,} characters)"


def _where(path: Path, lines: Mapping[KeyPath, int], key: KeyPath) -> str:
    for length in range(len(key), 0, -1):
        if key[:length] in lines:
            return f"{path}:{lines[key[:length]]}"
    return str(path)


def _explain(schema: Mapping[str, Any], error: Mapping[str, Any], section: str) -> str:
    kind, loc = error["type"], error["loc"]
    if kind == "extra_forbidden":
        known = _schema_at(schema, loc[:-1]).get("properties", {})
        return f"unknown key; {_known(str(loc[-1]), known)}{_page_hint(section)}"
    field = _schema_at(schema, loc)
    if kind in {"union_tag_not_found", "union_tag_invalid"}:
        key, kinds = field["discriminator"]["propertyName"], field["discriminator"]["mapping"]
        given = error["input"].get(key) if isinstance(error["input"], Mapping) else None
        return f"{key} {'is missing' if given is None else f'is {given}'}; it is one of {', '.join(kinds)}"
    suffix = f" ({field['description']})" if field.get("description") else ""
    if kind == "missing":
        return f"is missing{suffix}{_page_hint(section, 'an example is')}"
    if kind == "value_error":
        return str(error["ctx"]["error"])
    given = _shown(json.dumps(error["input"], ensure_ascii=False, default=str))
    if kind == "string_pattern_mismatch" and suffix:
        return f"must have another form than {given}{suffix}"
    return f"{_wanted(field, error)}, and is {given}{suffix}"


def _wanted(field: Mapping[str, Any], error: Mapping[str, Any]) -> str:
    """Say what a value should be."""
    kind, context = error["type"], error.get("ctx", {})
    if kind in _TYPES_IN_WORDS:
        return f"must be {_TYPES_IN_WORDS[kind]}"
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind in {"greater_than", "greater_than_equal", "less_than", "less_than_equal"} and _range(field):
        return f"must be {_range(field)}"
    if kind in {"string_too_long", "string_too_short"}:
        limit = f"at most {context['max_length']:,}" if kind.endswith("long") else f"at least {context['min_length']:,}"
        return f"must have {limit} characters"
    if kind in {"too_long", "too_short"}:
        limit = f"at most {context['max_length']:,}" if kind.endswith("long") else f"at least {context['min_length']:,}"
        return f"must have {limit} entries"
    return str(error["msg"][0].lower() + error["msg"][1:])


def _known(key: str, known: Iterable[str]) -> str:
    close = nearest_word(key, known)
    return f"did you mean {close}?" if close else f"known keys are {', '.join(known)}"


def _range(field: Mapping[str, Any]) -> str:
    words = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}
    return " and ".join(f"{word} {field[key]}" for key, word in words.items() if key in field)


def _schema_at(schema: Mapping[str, Any], loc: tuple[str | int, ...]) -> Mapping[str, Any]:
    """Return the part of a JSON schema that describes `loc`; empty where the schema branches on the value."""
    here: Mapping[str, Any] = schema
    for step in (*loc, None):
        while "$ref" in here:
            target = schema["$defs"][here["$ref"].rpartition("/")[2]]
            here = {**target, **{key: value for key, value in here.items() if key != "$ref"}}
        if step is None:
            return here
        if isinstance(step, int):
            here = here.get("items", {})
        elif "discriminator" in here:  # the step is the value of the discriminator
            here = {"$ref": here["discriminator"]["mapping"][step]}
        else:
            below = here.get("properties", {}).get(step, here.get("additionalProperties", {}))
            here = below if isinstance(below, dict) else {}
    return here
