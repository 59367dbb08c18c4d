"""The code that bytes depend on: the project's own modules that a module reaches by its imports, as digests.

A digest is of what a file says to Python: its syntax tree without docstrings, so that comments, docstrings and
formatting make nothing anew. Imports are followed wherever they stand, inside functions too, but not those for types
alone (`if TYPE_CHECKING:`). What is found at run time, by a name in a config, is reached by no import: whoever plans
with it names it in `Shard.code`.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import importlib.util
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from pipeline.shards import json_bytes

_DECLARATIONS = ("language",)
"""Files beside a `stage.py` that others find at run time when they read what the stage has made."""

_CONTRACT = {"pipeline.stage", "pipeline.config", "pipeline.paths", "pipeline.registry"}
"""What stages see of the mill itself. It changes bytes through the config and the plan alone, which the fingerprint
holds; with it the whole mill would count."""

_BEHIND_THE_TASK = "pipeline.randomness"
"""What makes bytes of the mill without being imported by a stage: `Task.rng`."""


def entry_points(module: str, also: Iterable[str] = ()) -> tuple[str, ...]:
    """Where the code of a shard begins: the module of its stage, what is declared beside it, and the modules `also`."""
    folder, house = module.rpartition(".")[0], SourceTree([module])
    beside = [f"{folder}.{name}" for name in _DECLARATIONS] if folder else []
    return (module, _BEHIND_THE_TASK, *(each for each in beside if house.file(each) is not None), *also)


def transitive_imports(starts: Iterable[str]) -> dict[str, str]:
    """The modules of the project that `starts` reach, themselves among them, and the digest of each.

    Raises ValueError for a start without a Python file.
    """
    waiting = list(starts)
    house = SourceTree(waiting)
    for start in waiting:
        if house.file(start) is None:
            raise ValueError(f"no Python file of module {start} is found")
    found: dict[str, str] = {}
    seen = {""}
    while waiting:
        module = waiting.pop()
        if module in seen or module in _CONTRACT:
            continue
        seen.add(module)
        file = house.file(module)
        if file is None:
            continue
        state = file.stat()
        found[module], imported = _read(str(file), state.st_mtime_ns, state.st_size)
        package = module if file.name == "__init__.py" else module.rpartition(".")[0]
        waiting += [module.rpartition(".")[0], *(absolute_name(each, package) for each in imported)]
    return dict(sorted(found.items()))


def code_digest(modules: Mapping[str, str]) -> str:
    """One digest of what `transitive_imports` answers."""
    return hashlib.sha256(json_bytes(dict(modules))).hexdigest()


class SourceTree:
    """Finds the files of the project's modules without importing any.

    The project is what is neither Python's own nor installed, and the packages of `starts`, wherever they are.
    """

    def __init__(self, starts: Iterable[str]) -> None:
        self._folders: dict[str, list[Path]] = {}
        self._listings: dict[Path, frozenset[str]] = {}
        self._owned = {start.partition(".")[0] for start in starts}

    def file(self, module: str) -> Path | None:
        """The Python file of a module of the project; None for anything else."""
        package, _, name = module.rpartition(".")
        for folder in self._within(package) if package else self._bases(module):
            listing = self._listing(folder)
            if name in listing and "__init__.py" in self._listing(folder / name):
                return folder / name / "__init__.py"
            if f"{name}.py" in listing:
                return folder / f"{name}.py"
        return None

    def _listing(self, folder: Path) -> frozenset[str]:
        """The names in a folder; none for what is no folder."""
        if folder not in self._listings:
            self._listings[folder] = (
                frozenset(each.name for each in folder.iterdir()) if folder.is_dir() else frozenset()
            )
        return self._listings[folder]

    def _within(self, package: str) -> list[Path]:
        """The folders in which the modules of a package lie; a package may have several."""
        if package not in self._folders:
            above, _, name = package.rpartition(".")
            loaded = getattr(sys.modules.get(package), "__path__", None)
            bases = self._within(above) if above else self._bases(package)
            if loaded is not None and bases:
                self._folders[package] = [Path(each) for each in loaded]
            else:
                self._folders[package] = [base / name for base in bases]
        return self._folders[package]

    def _bases(self, top: str) -> list[Path]:
        """The folders that hold the package or module `top`; none if it is not the project's."""
        key = f".{top}"
        if key not in self._folders:
            self._folders[key] = [] if top in sys.stdlib_module_names else list(self._search(top))
        return self._folders[key]

    def _search(self, top: str) -> Iterator[Path]:
        try:
            spec = importlib.util.find_spec(top)
        except ValueError:  # `__main__`
            return
        if spec is None:
            return
        for place in spec.submodule_search_locations or ([spec.origin] if spec.origin else []):
            base = Path(place).parent
            if top in self._owned or not {"site-packages", "dist-packages"} & set(base.parts):
                yield base


_Said = tuple[str, tuple[tuple[int, str], ...]]
"""The digest of a file, and the modules that it may import, each with its number of leading dots."""


@cache
def _read(file: str, modified: int, size: int) -> _Said:
    """What a file says in one state."""
    source = Path(file).read_bytes()
    key = hashlib.sha256(_reader() + source).hexdigest()
    note = read_note(file, "said", key)
    with suppress(ValueError, KeyError, TypeError):
        if note is not None:
            return str(note["digest"]), tuple((int(dots), str(name)) for dots, name in note["imports"])
    said = _parsed(source, file)
    write_note(file, "said", key, {"digest": said[0], "imports": said[1]})
    return said


def _parsed(source: bytes, file: str) -> _Said:
    with _no_collection():
        words: list[str] = []
        imported: list[tuple[int, str]] = []
        code_words(ast.parse(source, file), words.append, imported)
        return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16], tuple(dict.fromkeys(imported))


@cache
def _reader() -> bytes:
    """What else the answer depends on: this file, which reads. Each version of Python has notes of its own."""
    return Path(__file__).read_bytes()


def read_note(file: str, subject: str, key: str) -> dict[str, Any] | None:
    """The note that `write_note` left beside Python's own compiled files under the same key; None without one.

    Parsing all sources takes most of a second, and every start of a stage and every worker needs the result.
    """
    try:
        note = json.loads(_note_path(file, subject).read_bytes())
        return note if note["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_note(file: str, subject: str, key: str, note: Mapping[str, Any]) -> None:
    """Keep a note about a source file where that is possible; one that a crash cut short reads as none."""
    if sys.dont_write_bytecode:
        return
    path = _note_path(file, subject)
    own = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(exist_ok=True)
        own.write_bytes(json_bytes({"key": key, **note}))
        own.replace(path)
    except OSError:
        with suppress(OSError):
            own.unlink()


def _note_path(file: str, subject: str) -> Path:
    return Path(importlib.util.cache_from_source(file)).with_suffix(f".{subject}.json")


@contextmanager
def _no_collection() -> Iterator[None]:
    # A syntax tree is many small objects and no garbage: with the collector on, reading takes three times as long.
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def code_words(node: ast.AST, add: Callable[[str], None], imported: list[tuple[int, str]]) -> None:
    """Add the words of a syntax tree: node types and values in order, no line numbers, no docstrings."""
    if isinstance(node, ast.Import):
        imported.extend((0, alias.name) for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        imported.append((node.level, base))
        imported.extend((node.level, f"{base}.{alias.name}".lstrip(".")) for alias in node.names)
    add(type(node).__name__)
    for name in node._fields:
        value = getattr(node, name, None)
        if isinstance(value, ast.AST):
            code_words(value, add, imported)
        elif not isinstance(value, list):
            add(repr(value))
        elif not (name == "body" and isinstance(node, ast.If) and _for_types(node.test)):
            add("[")
            for each in value:
                if not isinstance(each, ast.AST):
                    add(repr(each))
                elif not is_prose(each):
                    code_words(each, add, imported)
            add("]")


def _for_types(test: ast.expr) -> bool:
    name = test.attr if isinstance(test, ast.Attribute) else getattr(test, "id", "")
    return name == "TYPE_CHECKING"


def is_prose(node: ast.AST) -> bool:
    """Whether a statement is a text by itself: a docstring, or one that stands after what it describes."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def absolute_name(imported: tuple[int, str], package: str) -> str:
    """The full name of what a module of `package` imports after so many leading dots."""
    dots, name = imported
    if not dots:
        return name
    above = package.split(".")[: len(package.split(".")) - dots + 1]
    return ".".join([*above, name]).rstrip(".")
