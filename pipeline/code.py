"""Digests of the code that bytes depend on: the project's modules that a module imports, directly or not.

A digest is of the syntax tree without docstrings, so that edits of comments, docstrings and formatting rebuild nothing.
Imports inside functions count, those for types alone (`if TYPE_CHECKING:`) do not. Modules found at run time, by a name
in a config, are named in `Shard.code`.
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
"""Modules in the folder of a stage that readers of its shards find at run time."""

_CONTRACT = {"pipeline.stage", "pipeline.config", "pipeline.paths", "pipeline.registry"}
"""The engine as stages see it; it changes bytes only through config and plan, which the fingerprint holds."""

_TASK_RANDOMNESS = "pipeline.randomness"
"""Code of `Task.rng`, which changes bytes although no stage imports it."""


def entry_points(module: str, also: Iterable[str] = (), tree: SourceTree | None = None) -> tuple[str, ...]:
    """Return the modules at which a shard's code begins: its stage's, those declared in its folder, and `also`.

    tree: finds the files of modules; one of its own if None
    """
    folder, tree = module.rpartition(".")[0], SourceTree([module]) if tree is None else tree
    declared = [f"{folder}.{name}" for name in _DECLARATIONS] if folder else []
    return (module, _TASK_RANDOMNESS, *(name for name in declared if tree.file(name) is not None), *also)


def transitive_imports(starts: Iterable[str], tree: SourceTree | None = None) -> dict[str, str]:
    """Return the digest of each module of the project that `starts` import, directly or not, and of themselves.

    tree: finds the files of modules; one of its own if None
    Raises ValueError for a start without a Python file.
    """
    waiting = list(starts)
    tree = SourceTree(waiting) if tree is None else tree
    for start in waiting:
        if tree.file(start) is None:
            raise ValueError(f"no Python file of module {start} is found")
    digests: dict[str, str] = {}
    seen = {""}
    while waiting:
        module = waiting.pop()
        if module in seen or module in _CONTRACT:
            continue
        seen.add(module)
        found = tree.read(module)
        if found is not None:
            digests[module], imported = found
            waiting += imported
    return dict(sorted(digests.items()))


def code_digest(modules: Mapping[str, str]) -> str:
    """Return one digest of the result of `transitive_imports`."""
    return hashlib.sha256(json_bytes(dict(modules))).hexdigest()


class SourceTree:
    """Finds the files of the project's modules without importing any.

    The project is every module that is neither Python's own nor installed, and the packages of `starts`.
    """

    def __init__(self, starts: Iterable[str]) -> None:
        self._folders: dict[str, list[Path]] = {}
        self._listings: dict[Path, frozenset[str]] = {}
        self._known: dict[str, tuple[str, tuple[str, ...]] | None] = {}
        self._owned = {start.partition(".")[0] for start in starts}

    def file(self, module: str) -> Path | None:
        """Return the Python file of a module of the project; None for any other module."""
        package, _, name = module.rpartition(".")
        for folder in self._within(package) if package else self._bases(module):
            listing = self._listing(folder)
            if name in listing and "__init__.py" in self._listing(folder / name):
                return folder / name / "__init__.py"
            if f"{name}.py" in listing:
                return folder / f"{name}.py"
        return None

    def read(self, module: str) -> tuple[str, tuple[str, ...]] | None:
        """Return the digest of a module of the project as it first was, and the modules that it may import; None for
        any other module.
        """
        if module not in self._known:
            file, self._known[module] = self.file(module), None
            if file is not None:
                state = file.stat()
                digest, imported = _read(str(file), state.st_mtime_ns, state.st_size)
                package = module if file.name == "__init__.py" else module.rpartition(".")[0]
                names = (module.rpartition(".")[0], *(absolute_name(name, package) for name in imported))
                self._known[module] = digest, names
        return self._known[module]

    def _listing(self, folder: Path) -> frozenset[str]:
        """Return the names in a folder; none if it is no folder."""
        if folder not in self._listings:
            self._listings[folder] = (
                frozenset(path.name for path in folder.iterdir()) if folder.is_dir() else frozenset()
            )
        return self._listings[folder]

    def _within(self, package: str) -> list[Path]:
        """Return the folders of a package; it may have several."""
        if package not in self._folders:
            above, _, name = package.rpartition(".")
            loaded = getattr(sys.modules.get(package), "__path__", None)
            bases = self._within(above) if above else self._bases(package)
            if loaded is not None and bases:
                self._folders[package] = [Path(folder) for folder in loaded]
            else:
                self._folders[package] = [base / name for base in bases]
        return self._folders[package]

    def _bases(self, top: str) -> list[Path]:
        """Return the folders that hold the package or module `top`; none if it is not the project's."""
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
        for location in spec.submodule_search_locations or ([spec.origin] if spec.origin else []):
            base = Path(location).parent
            if top in self._owned or not {"site-packages", "dist-packages"} & set(base.parts):
                yield base


_Summary = tuple[str, tuple[tuple[int, str], ...]]
"""Digest of a file, and the modules that it may import, each with its number of leading dots."""


@cache
def _read(file: str, modified: int, size: int) -> _Summary:
    """Return the digest and the imports of a file in one state."""
    source = Path(file).read_bytes()
    key = hashlib.sha256(_reader() + source).hexdigest()
    note = read_note(file, "imports", key)
    with suppress(ValueError, KeyError, TypeError):
        if note is not None:
            return str(note["digest"]), tuple((int(dots), str(name)) for dots, name in note["imports"])
    digest, imports = _parsed(source, file)
    write_note(file, "imports", key, {"digest": digest, "imports": imports})
    return digest, imports


def _parsed(source: bytes, file: str) -> _Summary:
    with _without_garbage_collection():
        words: list[str] = []
        imported: list[tuple[int, str]] = []
        try:
            tree = ast.parse(source, file)
        except SyntaxError:  # a file that nobody can import, such as a table that is being written
            return hashlib.sha256(source).hexdigest()[:16], ()
        code_words(tree, words.append, imported)
        return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16], tuple(dict.fromkeys(imported))


@cache
def _reader() -> bytes:
    """Return the source of this file, on which the digests depend; each version of Python has notes of its own."""
    return Path(__file__).read_bytes()


def read_note(file: str, subject: str, key: str) -> dict[str, Any] | None:
    """Return the note that `write_note` left under the same key, next to Python's compiled files; None without one.

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
def _without_garbage_collection() -> Iterator[None]:
    # A syntax tree is many small objects and no garbage: the collector would triple the time.
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def code_words(node: ast.AST, add: Callable[[str], None], imported: list[tuple[int, str]]) -> None:
    """Add the words of a syntax tree in order: node types and values, no line numbers, no docstrings."""
    if isinstance(node, ast.Import):
        imported.extend((0, alias.name) for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        imported.append((node.level, base))
        imported.extend((node.level, f"{base}.{alias.name}".lstrip(".")) for alias in node.names)
    add(type(node).__name__)
    for name in node._fields:
        value = getattr(node, name, None)
        if name == "type_params" and not value:
            continue  # which Python 3.12 adds to every function and class: one digest on all Pythons
        if isinstance(value, ast.AST):
            code_words(value, add, imported)
        elif not isinstance(value, list):
            add(repr(value))
        elif not (name == "body" and isinstance(node, ast.If) and _for_types(node.test)):
            add("[")
            for item in value:
                if not isinstance(item, ast.AST):
                    add(repr(item))
                elif not is_prose(item):
                    code_words(item, add, imported)
            add("]")


def _for_types(test: ast.expr) -> bool:
    name = test.attr if isinstance(test, ast.Attribute) else getattr(test, "id", "")
    return name == "TYPE_CHECKING"


def is_prose(node: ast.AST) -> bool:
    """Whether a statement is only a text: a docstring, of a function or of an attribute."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def absolute_name(imported: tuple[int, str], package: str) -> str:
    """Return the full name of an import in a module of `package`: (leading dots, name)."""
    dots, name = imported
    if not dots:
        return name
    above = package.split(".")[: len(package.split(".")) - dots + 1]
    return ".".join([*above, name]).rstrip(".")
