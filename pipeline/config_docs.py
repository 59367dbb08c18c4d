"""The keys of a config as Markdown pages, one a section, written from the models that check them."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from pipeline.config import DatasetFacts, StrictModel
from pipeline.stage import Stage

HEADING = "\n## Keys\n"
"""What stands between the part of a page that people write and the part that is generated."""


def write_config_pages(folder: Path, stages: Mapping[str, Stage]) -> list[Path]:
    """Write the keys of every section into its page in `folder`; what a page says above them stays.

    Returns the pages. Pages that are missing begin with their title alone.
    """
    pages = []
    for name, model in _sections(stages).items():
        page = folder / f"{name}.md"
        head = page.read_text(encoding="utf-8").partition(HEADING)[0] if page.exists() else f"# Section `{name}`\n"
        page.write_text(f"{head}{HEADING}\n{section_table(name, model)}", encoding="utf-8")
        pages.append(page)
    return pages


def outdated_pages(folder: Path, stages: Mapping[str, Stage]) -> list[str]:
    """Return the names of sections whose page is missing or lists other keys than the models do."""
    names = []
    for name, model in _sections(stages).items():
        page = folder / f"{name}.md"
        keys = page.read_text(encoding="utf-8").partition(HEADING)[2] if page.exists() else ""
        if keys.lstrip("\n") != section_table(name, model):
            names.append(name)
    return names


def section_table(name: str, model: type[StrictModel]) -> str:
    """Return the keys of one section as a Markdown table; those of `dataset` have no prefix."""
    prefix = "" if model is DatasetFacts else f"{name}."
    rows = [f"| `{key}` | {kind} | {default} | {text} |" for key, kind, default, text in _rows(prefix, model)]
    return "\n".join(["| key | value | default | what it does |", "|---|---|---|---|", *rows]) + "\n"


def _sections(stages: Mapping[str, Stage]) -> dict[str, type[StrictModel]]:
    return {"dataset": DatasetFacts, **{name: stage.config for name, stage in stages.items()}}


def _rows(prefix: str, model: type[StrictModel]) -> Iterator[tuple[str, str, str, str]]:
    for name, field in model.model_fields.items():
        inner, many = _inner_models(field.annotation)
        key = f"{prefix}{name}{'[]' if many else ''}"
        text = (field.description or "").strip()
        yield key, _kind(field), "" if inner else _default(field), text[:1].upper() + text[1:]
        yield from _rows_of_any(f"{key}.", inner)


def _rows_of_any(prefix: str, models: Mapping[str, type[StrictModel]]) -> Iterator[tuple[str, str, str, str]]:
    """The rows of models one of which a key holds, by what its entry says of itself: what all of them know first, then
    what each knows besides."""
    rows = {kind: list(_rows(prefix, model)) for kind, model in models.items()}
    shared = [row for row in next(iter(rows.values()), []) if all(row in of_kind for of_kind in rows.values())]
    yield from shared
    for kind, of_kind in rows.items():
        for key, value, default, text in (row for row in of_kind if row not in shared):
            yield key, value, default, f"Of `{kind}`: {text[:1].lower()}{text[1:]}"


def _inner_models(annotation: Any) -> tuple[dict[str, type[StrictModel]], bool]:
    """The section models that a key may hold, by the value of the key that tells them apart, and whether it holds a
    list of them."""
    many = get_origin(annotation) in (tuple, list)
    inner = get_args(annotation)[0] if many else annotation
    metadata: Sequence[Any] = ()
    if get_origin(inner) is Annotated:
        inner, *metadata = get_args(inner)
    models = [each for each in (inner, *get_args(inner)) if isinstance(each, type) and issubclass(each, StrictModel)]
    told_by = next((each.discriminator for each in metadata if isinstance(each, FieldInfo)), None)
    if not isinstance(told_by, str):
        return ({"": models[0]}, many) if models else ({}, False)
    return {str(get_args(each.model_fields[told_by].annotation)[0]): each for each in models}, many


def _kind(field: FieldInfo) -> str:
    """The type of a key and its range, in words."""
    return f"{_words(field.annotation)}{_bounds(field.metadata)}"


def _bounds(metadata: Sequence[Any]) -> str:
    """A range in words, behind a comma; empty where there is none."""
    limits = {type(each): each for each in metadata}
    low, high = "", ""
    for kind, sign in ((annotated_types.Ge, ">= "), (annotated_types.Gt, "> ")):
        if kind in limits:
            low = f"{sign}{getattr(limits[kind], kind.__name__.lower())}"
    for limit, sign in ((annotated_types.Le, "<= "), (annotated_types.Lt, "< ")):
        if limit in limits:
            high = f"{sign}{getattr(limits[limit], limit.__name__.lower())}"
    return "".join(f", {each}" for each in (low, high) if each)


def _words(annotation: Any) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _words(arguments[0]) + "".join(
            _bounds(each.metadata) for each in arguments if isinstance(each, FieldInfo)
        )
    if origin is Literal:
        return " or ".join(f"`{each}`" for each in arguments)
    if origin in (tuple, list):
        return f"list of {_words(arguments[0])}"
    if origin is dict:
        return f"names, each with {_words(arguments[1])}"
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(map(_words, arguments)))
    if annotation is type(None):
        return "nothing"
    if isinstance(annotation, type) and issubclass(annotation, StrictModel):
        return "keys below"
    plain = {int: "whole number", float: "number", str: "text", bool: "true or false", Path: "path"}
    return plain.get(annotation, str(annotation))


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined:
        return ""
    if isinstance(value, tuple):
        return ", ".join(f"`{_shown(each)}`" for each in value) or "none"
    return f"`{_shown(value)}`" if value != "" else "empty"


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return value.model_dump_json() if isinstance(value, StrictModel) else str(value)
