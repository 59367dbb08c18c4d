"""What a dataset was made with: the version of this code, and those of the libraries that it needs."""

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
def code_version(*besides: ModuleType) -> str:
    """The project's version and a digest of its code, of the packages `besides` as well, `0.1.0+3f2a9c01d4e7`.

    It is a function of what the code says alone, comments and docstrings aside, so that the same code says the same in
    a checkout, in a fresh clone and in a copy without history, and an edited file says so by itself.
    """
    digest = code_digest(
        transitive_imports(name for package in (pipeline, stages, *besides) for name in _modules(package))
    )
    return f"{_project()['version']}+{digest[:12]}"


def _modules(package: ModuleType) -> Iterator[str]:
    """The names of all modules of a package, wherever its folders lie."""
    for root in map(Path, package.__path__):
        for path in root.rglob("*.py"):
            steps = path.relative_to(root).with_suffix("").parts
            yield ".".join([package.__name__, *(steps[:-1] if steps[-1] == "__init__" else steps)])


@cache
def library_versions() -> dict[str, str]:
    """The versions of the libraries that pyproject.toml lists, by name; those that are not installed are left out."""
    found = {}
    for asked in sorted(_project()["dependencies"], key=str.lower):
        name = re.split(r"[^\w.-]", asked, maxsplit=1)[0]
        try:
            found[name] = version(name).partition("+")[0]  # +cpu says where it came from, not what it is
        except PackageNotFoundError:
            continue
    return found


def _project() -> dict[str, Any]:
    project: dict[str, Any] = tomllib.loads(PROJECT.read_text())["project"]
    return project
