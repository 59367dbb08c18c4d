"""Finds the tables: every module of `eval.tables`, wherever its folders lie."""

from __future__ import annotations

import importlib
from pkgutil import iter_modules

from eval.engine.evaluation import Evaluation


def find_tables(package: str = "eval.tables") -> dict[str, Evaluation]:
    """The `TABLE` of each `eval/tables/<name>.py`, by name. Raises TypeError for a module without it."""
    found: dict[str, Evaluation] = {}
    for name in sorted(each.name for each in iter_modules(importlib.import_module(package).__path__)):
        declared = getattr(importlib.import_module(f"{package}.{name}"), "TABLE", None)
        if not isinstance(declared, Evaluation):
            raise TypeError(f"{package.replace('.', '/')}/{name}.py must hold TABLE = Evaluation(...)")
        found[name] = declared
    return found
