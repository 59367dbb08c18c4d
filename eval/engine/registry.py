"""Finds the tables: every module of `eval.tables`, in all folders of that name on the path."""

from __future__ import annotations

import importlib
import traceback
from pathlib import Path
from pkgutil import iter_modules

from eval.engine.evaluation import Evaluation
from pipeline.package_groups import missing_group


def read_tables(package: str = "eval.tables") -> tuple[dict[str, Evaluation], dict[str, str]]:
    """Return the `TABLE` of each `eval/tables/<name>.py`; and for a file without one, its line and what is wrong."""
    tables: dict[str, Evaluation] = {}
    faults: dict[str, str] = {}
    for module in sorted(iter_modules(importlib.import_module(package).__path__), key=lambda module: module.name):
        path = Path(getattr(module.module_finder, "path", ""), f"{module.name}.py")
        try:
            table = getattr(importlib.import_module(f"{package}.{module.name}"), "TABLE", None)
        except Exception as error:
            if missing_group(error):
                raise
            faults[module.name] = _fault(path, error)
            continue
        if isinstance(table, Evaluation):
            tables[module.name] = table
        else:
            faults[module.name] = f"{path} must hold TABLE = Evaluation(...)"
    return tables, faults


def _fault(path: Path, error: Exception) -> str:
    """Say in which line of a table's file, or of what it imports, an error is."""
    where = f"{path}"
    if isinstance(error, SyntaxError):
        where = f"{error.filename or path}:{error.lineno}"
    else:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
        where = f"{path}:{lines[-1]}" if lines else where
    reason = error.msg if isinstance(error, SyntaxError) else error
    return f"{where}: {type(error).__name__}: {reason}"
