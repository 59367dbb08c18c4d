"""What Python's environment must be before anything else is imported: UTF-8 text, and packages of .venv first.

Imports only the standard library.
"""

from __future__ import annotations

import locale
import os
import sys
import sysconfig
from pathlib import Path

_UTF8_NAMES = {"utf-8", "utf8"}
_MAX_NAMES_SHOWN = 3


def prepare_interpreter() -> None:
    """Start this process again where the locale is not UTF-8 or the PYTHONPATH hides packages of .venv.

    The new process and its workers read and print UTF-8, and import packages of .venv before those of the PYTHONPATH.
    """
    os.environ.pop("PYTHONSAFEPATH", None)  # child processes find the project in their working folder
    if sys.flags.ignore_environment:
        return
    changes = {}
    in_utf8 = sys.flags.utf8_mode or locale.getencoding().lower() in _UTF8_NAMES
    if not in_utf8 and os.environ.get("PYTHONUTF8") != "1":
        changes["PYTHONUTF8"] = "1"
    packages, search_path = sysconfig.get_path("purelib"), os.environ.get("PYTHONPATH", "")
    hidden = hidden_packages(Path(packages), search_path)
    if hidden:
        more = f" and {len(hidden) - _MAX_NAMES_SHOWN} more" if len(hidden) > _MAX_NAMES_SHOWN else ""
        names = ", ".join(hidden[:_MAX_NAMES_SHOWN]) + more
        print(f"PYTHONPATH holds {names}: the packages of {packages} are used instead", file=sys.stderr, flush=True)
        changes["PYTHONPATH"] = os.pathsep.join([packages, search_path])
    if changes:
        os.environ.update(changes)
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def hidden_packages(packages: Path, search_path: str) -> list[str]:
    """Return the installed packages that a PYTHONPATH would replace by its own, as paths there.

    packages: folder of installed packages
    """
    folders = [folder for folder in search_path.split(os.pathsep) if folder]
    if not folders or Path(folders[0]) == packages or not packages.is_dir():
        return []
    installed = {path.name for path in packages.iterdir() if _is_module(path)}
    paths = [path for folder in map(Path, folders) if folder.is_dir() for path in sorted(folder.iterdir())]
    return [str(path) for path in paths if path.name in installed and _is_module(path)]


def _is_module(path: Path) -> bool:
    return path.suffix == ".py" or (path / "__init__.py").is_file()
