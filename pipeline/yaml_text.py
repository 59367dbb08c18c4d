"""YAML as people mistype it: values with the line of every key, duplicate keys refused, `1e-3` a number."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import ConfigError

__all__ = ["KeyPath", "read_yaml"]

KeyPath = tuple[str | int, ...]


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
    """The mapping in a YAML file, and the line (from 1) where each key and list item stands.

    Raises ConfigError, with file and line, for an unreadable file, bad syntax, a duplicate key, a key that is no
    text, and a file that holds no mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is no UTF-8 text ({error.reason} at byte {error.start})") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    loader = _Loader(text)
    try:
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
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"{path}: is no YAML: {error}") from error
    finally:
        loader.dispose()


def _collect(path: Path, node: yaml.Node, place: KeyPath, lines: dict[KeyPath, int]) -> None:
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
                raise ConfigError(f"{path}:{line}: key {key.value!r} must be text: put it in quotes")
            below = (*place, key.value)
            if below in lines:
                dotted = ".".join(str(each) for each in below)
                raise ConfigError(f"{path}:{line}: key {dotted} stands twice; first in line {lines[below]}")
            lines[below] = line
            _collect(path, value, below, lines)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            lines[*place, index] = value.start_mark.line + 1
            _collect(path, value, (*place, index), lines)
