"""YAML with the line of every key; duplicate keys are refused, and `1e-3` is a number.

A file is scanned event by event before values are built: aliases may expand to billions of values, and the builder
recurses as deep as the file nests.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import ConfigError

KeyPath = tuple[str | int, ...]


MAX_CHARACTERS = 1_000_000
MAX_DEPTH = 40
MAX_VALUES = 50_000

_CONTROLS = frozenset(map(chr, (*range(9), 11, 12, *range(14, 32), 127)))


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader with the floats of YAML 1.2: in YAML 1.1 `1e-3` is a string."""


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+$"), list("-+0123456789.")
)


def read_yaml(path: Path) -> tuple[Mapping[str, Any], Mapping[KeyPath, int]]:
    """Return the mapping in a YAML file, and the line (from 1) of each key and list item.

    Raises ConfigError, with file and line, for an unreadable or huge file, bad syntax, a duplicate key, a key that is
    no text, a tag, values that contain themselves, deep nesting, too many values, and a file without a mapping.
    """
    try:
        text = _text(path)
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is no UTF-8 text ({error.reason} at byte {error.start})") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    loader = _Loader("")
    try:
        _scan(path, text)
        loader = _Loader(text)
        node = loader.get_single_node()
        lines: dict[KeyPath, int] = {}
        if not isinstance(node, yaml.MappingNode):
            raise ConfigError(f"{path}: must hold keys and values, one `key: value` a line")
        _collect(path, node, (), lines)
        return loader.construct_document(node), lines
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"{path}:{mark.line + 1}" if mark is not None else f"{path}"
        raise ConfigError(f"{where}: is no YAML: {error.problem or error.context}") from error
    except (yaml.YAMLError, ValueError):
        raise ConfigError(f"{path}: is no YAML: it holds an invalid character or number") from None
    finally:
        loader.dispose()


def _text(path: Path) -> str:
    if path.exists() and not path.is_file():
        raise ConfigError(f"{path}: is {'a folder' if path.is_dir() else 'no regular file'}; name one config file")
    with open(path, encoding="utf-8") as stream:
        text = stream.read(MAX_CHARACTERS + 1)
    if len(text) > MAX_CHARACTERS:
        raise ConfigError(f"{path}: is longer than {MAX_CHARACTERS:,} characters, which no config is")
    return text


def _scan(path: Path, text: str) -> None:
    """Raise ConfigError for tags, and for values that contain themselves, nest too deeply or are too many."""
    open_since: list[tuple[str | None, int]] = []
    sizes: dict[str | None, int] = {}
    count = 0
    for event in yaml.parse(text, Loader=_Loader):
        where = f"{path}:{event.start_mark.line + 1}" if event.start_mark is not None else f"{path}"
        if isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent) and event.tag is not None:
            tag = event.tag[:60].replace("tag:yaml.org,2002:", "!!")
            raise ConfigError(f"{where}: the tag {tag} is not read; write the value without it")
        if isinstance(event, yaml.AliasEvent):
            if any(anchor == event.anchor for anchor, _ in open_since):
                raise ConfigError(f"{where}: *{event.anchor} contains itself; write out what is meant")
            count += sizes.get(event.anchor, 1)
        elif isinstance(event, yaml.ScalarEvent):
            count += 1
            sizes[event.anchor] = 1
            if any(char in _CONTROLS or "\ud800" <= char <= "\udfff" for char in event.value):
                raise ConfigError(f"{where}: a value holds a control character or half a character; take it out")
        elif isinstance(event, yaml.CollectionStartEvent):
            open_since.append((event.anchor, count))
            count += 1
            if len(open_since) > MAX_DEPTH:
                raise ConfigError(f"{where}: nests deeper than {MAX_DEPTH}, which no config does")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_since.pop()
            sizes[anchor] = count - before
        if count > MAX_VALUES:
            raise ConfigError(f"{where}: holds more than {MAX_VALUES:,} values by here, which no config does")


def _collect(path: Path, node: yaml.Node, parent: KeyPath, lines: dict[KeyPath, int]) -> None:
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
                named = f"key {key.value!r}" if isinstance(key, yaml.ScalarNode) else "a key"
                raise ConfigError(f"{path}:{line}: {named} must be text: put it in quotes")
            below = (*parent, key.value)
            if below in lines:
                dotted = ".".join(map(str, below))
                raise ConfigError(f"{path}:{line}: key {dotted} is defined twice; first in line {lines[below]}")
            lines[below] = line
            _collect(path, value, below, lines)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            lines[*parent, index] = value.start_mark.line + 1
            _collect(path, value, (*parent, index), lines)
