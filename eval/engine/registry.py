"""Finds the tables: every module of `eval.tables`, in all folders of that name on the path."""

from __future__ import annotations

import importlib
from pkgutil import iter_modules

from eval.engine.evaluation import Evaluation


def find_tables(package: str = "eval.tables") -> dict[str, Evaluation]:
    """Return the `TABLE` of each `eval/tables/<name>.py`, by name. Raises TypeError for a module without one."""
    tables: dict[str, Evaluation] = {}
    for name in sorted(module.name for module in iter_modules(importlib.import_module(package).__path__)):
        table = getattr(importlib.import_module(f"{package}.{name}"), "TABLE", None)
        if not isinstance(table, Evaluation):
            raise TypeError(f"{package.replace('.', '/')}/{name}.py must hold TABLE = Evaluation(...)")
        tables[name] = table
    return tables
