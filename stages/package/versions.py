"""Versions of the code and of the libraries that a dataset was made with."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType
from typing import Any

import pipeline
import stages
from pipeline.code import code_digest, transitive_imports

PROJECT = Path(pipeline.__file__).parent.parent / "pyproject.toml"


@cache
def code_version(*packages: ModuleType) -> str:
    """Return the project's version and a digest of its code and of further packages: `0.1.0+3f2a9c01d4e7`.

    The digest depends only on the code without comments and docstrings, so that it is the same in every checkout and
    in a copy without history.
    """
    digest = code_digest(
        transitive_imports(name for package in (pipeline, stages, *packages) for name in _modules(package))
    )
    return f"{_project()['version']}+{digest[:12]}"


def _modules(package: ModuleType) -> Iterator[str]:
    """Yield the names of all modules of a package, in all its folders."""
    for root in map(Path, package.__path__):
        for path in root.rglob("*.py"):
            steps = path.relative_to(root).with_suffix("").parts
            yield ".".join([package.__name__, *(steps[:-1] if steps[-1] == "__init__" else steps)])


@cache
def library_versions() -> dict[str, str]:
    """Return the versions of the installed libraries that pyproject.toml lists, by name."""
    versions = {}
    for requirement in sorted(_project()["dependencies"], key=str.lower):
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        try:
            versions[name] = version(name).partition("+")[0]  # without a suffix such as +cpu
        except PackageNotFoundError:
            continue
    return versions


def _project() -> dict[str, Any]:
    project: dict[str, Any] = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    return project
