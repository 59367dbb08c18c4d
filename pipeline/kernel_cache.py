"""Cache of compiled kernels, addressed by content and shared by all checkouts with equal sources.

Numba's own cache depends on the path and the bytes of a kernel's file, and misses edits of callees in other files. Here
the key of a kernel is a digest of the functions, classes and constants that it reaches in the project's modules,
without comments, docstrings and formatting. The file name of an entry also depends on the argument types (with classes
and fields of named tuples), on Python, Numba and the CPU. So each file has one possible content, and concurrent
processes cannot mix their entries.

A wrapper through which Python calls a kernel takes a fifth of the time of its compilation, and most kernels are called
by kernels alone. So a kernel that another one calls is compiled without a wrapper. If Python calls it later, it is
compiled again with one, as an entry of its own.

A process that compiles a kernel holds a lock next to its entry. Others that need the kernel wait, then load it. A
process that holds one lock waits only for kernels that the locked one calls. Calls between kernels have no circles, so
waits have none either. MAX_WAIT_SECONDS ends what this leaves: a stopped process, kernels that call one another.

`stages/__init__.py` names `KernelLocator` to Numba in the environment; Numba imports it with the first cached kernel.
"""

from __future__ import annotations

import ast
import fcntl
import gc
import hashlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
from numba.core import caching, dispatcher, sigutils, types
from numba.core.compiler_lock import global_compiler_lock

from pipeline.code import SourceTree, absolute_name, code_words, is_prose, read_note, write_note
from pipeline.compilation_note import note_compilation, note_end_of_compilation
from pipeline.kernel_folder import DAY_SECONDS, kernel_folder
from pipeline.quick_compilation import quicken

MAX_WAIT_SECONDS = 600.0
"""A process that has waited this long for another's kernel compiles it by itself."""

_POLL_SECONDS = 0.05
_PACKAGES = ("pipeline", "stages", "eval")


class KernelLocator(caching._CacheLocator):  # type: ignore[misc]
    """Tells Numba where to keep the compiled code of a function of the project."""

    def __init__(self, py_func: Callable[..., Any], py_file: str) -> None:
        self._py_file = py_file
        self._py_func = py_func

    def get_cache_path(self) -> str:
        return str(kernel_folder() / self._py_func.__module__)

    def get_source_stamp(self) -> str:
        return self.get_disambiguator()

    def get_disambiguator(self) -> str:
        return kernel_key(self._py_func.__module__, self._py_func.__qualname__.partition(".")[0])[:16]

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> KernelLocator | None:
        """Return a locator for a function of the project; None for others, which keep Numba's own."""
        return cls(py_func, py_file) if _file(py_func.__module__) == Path(py_file) else None


# Entries ------------------------------------------------------------------------------------------------------------


def _entry(store: caching.FunctionCache, signature: Any, codegen: Any, is_wrapped: bool) -> caching.IndexDataCacheFile:
    """Return the index and data files for one signature on one CPU, with or without a wrapper for Python."""
    arguments, _ = sigutils.normalize_signature(signature)
    kinds = [_type_words(argument) for argument in arguments]
    words = repr((numba.__version__, codegen.magic_tuple(), kinds, is_wrapped))
    base = f"{store._impl.filename_base}.{hashlib.sha256(words.encode()).hexdigest()[:16]}"
    return caching.IndexDataCacheFile(store.cache_path, base, store._impl.locator.get_source_stamp())


def _type_words(argument: Any) -> Any:
    """Return everything in a type that code depends on; Numba's name of a named tuple lacks module and fields."""
    if isinstance(argument, types.BaseTuple):
        kind = getattr(argument, "instance_class", None)
        layout = (kind.__module__, kind.__qualname__, argument.fields) if kind else ()
        return (*layout, [_type_words(item) for item in argument.types])
    if isinstance(argument, types.Dispatcher):
        function = argument.dispatcher.py_func
        return kernel_key(function.__module__, function.__qualname__.partition(".")[0])
    return str(argument)


def _load(store: caching.FunctionCache, signature: Any, context: Any) -> Any:
    if not isinstance(store._impl.locator, KernelLocator):
        return _numba_load(store, signature, context)
    if not _compilations or not _compilations[-1].is_for_python:
        # A caller in a kernel uses an entry of either kind, and waits for one without a wrapper.
        compiled = _load_entry(store, signature, context, is_wrapped=True)
        return compiled or _load_or_lock(store, signature, context, is_wrapped=False)
    return _load_or_lock(store, signature, context, is_wrapped=True)


def _load_or_lock(store: caching.FunctionCache, signature: Any, context: Any, is_wrapped: bool) -> Any:
    compiled = _load_entry(store, signature, context, is_wrapped)
    if compiled is None and _compilations:
        note_compilation(len(_saved))
        lock = _lock(Path(store._cache_file._index_path))
        if lock is not None:
            _compilations[-1].locks.append(lock)
            compiled = _load_entry(store, signature, context, is_wrapped)
    return compiled


def _load_entry(store: caching.FunctionCache, signature: Any, context: Any, is_wrapped: bool) -> Any:
    store._cache_file = _entry(store, signature, context.codegen(), is_wrapped)
    index = Path(store._cache_file._index_path)
    try:
        compiled = _numba_load(store, signature, context)
        if compiled is not None and time.time() - index.stat().st_mtime > DAY_SECONDS:
            for used in index.parent.glob(f"{index.stem}*"):
                os.utime(used)
        return compiled
    except Exception:  # a corrupted entry can raise anything; the kernel is compiled again
        index.unlink(missing_ok=True)
        return None


def _save(store: caching.FunctionCache, signature: Any, compiled: Any) -> None:
    if isinstance(store._impl.locator, KernelLocator):
        store._cache_file = _entry(store, signature, compiled.codegen, _is_wrapped(compiled))
        with suppress(OSError):  # a full disk: the kernel works without an entry
            _numba_save(store, signature, compiled)
        _saved.append(store._cache_file._index_path)
        note_compilation(len(_saved))
    else:
        _numba_save(store, signature, compiled)


_numba_load, _numba_save = caching.FunctionCache.load_overload, caching.FunctionCache.save_overload
caching.FunctionCache.load_overload, caching.FunctionCache.save_overload = _load, _save


# Locks --------------------------------------------------------------------------------------------------------------


class _Lock(NamedTuple):
    """A lock that this process holds."""

    path: Path
    descriptor: int

    def release(self) -> None:
        """Delete the file, then unlock: whoever waits for it sees that it is gone."""
        with suppress(OSError):
            self.path.unlink()
        with suppress(OSError):
            fcntl.flock(self.descriptor, fcntl.LOCK_UN)  # closing alone would leave it to forked children
        os.close(self.descriptor)


class _Compilation(NamedTuple):
    """A call of `Dispatcher.compile` in progress."""

    is_for_python: bool
    """Whether Python calls the kernel, not another kernel."""
    locks: list[_Lock]


_compilations: list[_Compilation] = []
"""Callers before callees; guarded by Numba's compiler lock."""

_saved: list[str] = []
"""Entries of kernels that this process has compiled."""


def compile_for_kernels(kernel: dispatcher.Dispatcher, arguments: tuple[types.Type, ...]) -> None:
    """Compile a kernel that only kernels call."""
    _compile_for(kernel, arguments, is_for_python=False)


def _compile(kernel: dispatcher.Dispatcher, signature: Any) -> Any:
    with global_compiler_lock:
        return _compile_for(kernel, signature, is_for_python=not _compilations)


def _compile_for(kernel: dispatcher.Dispatcher, signature: Any, is_for_python: bool) -> Any:
    with global_compiler_lock:
        # A wrapper for callers in C takes a tenth of the time of compilation, and kernels have no such callers.
        kernel.targetoptions["no_cfunc_wrapper"] = True
        kernel.targetoptions["no_cpython_wrapper"] = not is_for_python
        arguments = tuple(sigutils.normalize_signature(signature)[0])
        if is_for_python and arguments in kernel.overloads and not _is_wrapped(kernel.overloads[arguments]):
            del kernel.overloads[arguments]
        _compilations.append(_Compilation(is_for_python, []))
        collects = gc.isenabled()
        gc.disable()  # a kernel leaves little garbage, and looking for it takes a tenth of the time
        try:
            return _numba_compile(kernel, signature)
        finally:
            if collects:
                gc.enable()
            for lock in _compilations.pop().locks:
                lock.release()
            if not _compilations:
                note_end_of_compilation(len(_saved))


def _add_overload(kernel: dispatcher.Dispatcher, compiled: Any) -> None:
    """Give compiled code to Python's calls if it has a wrapper, else to callers in kernels alone."""
    if _is_wrapped(compiled):
        _numba_add_overload(kernel, compiled)
    else:
        kernel.overloads[tuple(compiled.signature.args)] = compiled


def _is_wrapped(compiled: Any) -> bool:
    return bool(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cpython_wrapper_name))


def _lock(index: Path) -> _Lock | None:
    """Wait for the lock of an entry; None where it cannot be had, and the kernel is compiled without it.

    So it is in a folder that cannot be written or locked, in a kernel that calls itself, and after MAX_WAIT_SECONDS.
    """
    path = index.with_name(f".{index.name}.lock")
    if any(lock.path == path for compilation in _compilations for lock in compilation.locks):
        return None
    until = time.monotonic() + MAX_WAIT_SECONDS
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        while time.monotonic() < until:
            lock = _Lock(path, os.open(path, os.O_RDWR | os.O_CREAT, 0o644))
            locked = False
            try:
                locked = _flock(lock.descriptor, until) and _is_current(lock)
            finally:
                if not locked:
                    os.close(lock.descriptor)
            if locked:
                return lock
    return None


def _flock(descriptor: int, until: float) -> bool:
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if time.monotonic() > until:
                return False
            time.sleep(_POLL_SECONDS)


def _is_current(lock: _Lock) -> bool:
    """Whether the locked file still has its name: the process that held it before may have deleted it."""
    try:
        return os.path.samestat(lock.path.stat(), os.fstat(lock.descriptor))
    except FileNotFoundError:
        return False


_numba_compile, _numba_add_overload = dispatcher.Dispatcher.compile, dispatcher.Dispatcher.add_overload
dispatcher.Dispatcher.compile, dispatcher.Dispatcher.add_overload = _compile, _add_overload
quicken()


def is_cached(kernel: dispatcher.Dispatcher, arguments: tuple[types.Type, ...], is_for_python: bool) -> bool:
    """Whether a kernel of the project is compiled for these types of arguments and for Python, or for other kernels."""
    codegen = kernel.targetctx.codegen()
    return any(
        Path(_entry(kernel._cache, arguments, codegen, is_wrapped)._index_path).is_file()
        for is_wrapped in ((True,) if is_for_python else (True, False))
    )


# Keys ---------------------------------------------------------------------------------------------------------------


class _Statement(NamedTuple):
    """A statement of a module's top level."""

    binds: list[str]
    """Names that it defines or changes."""
    loads: list[str]
    """Names of the module that it reads."""
    imports: list[tuple[str, str]]
    """Imports in it: the name bound at the module's top level or "", and the full dotted name."""
    digest: str
    """Of its syntax tree; empty for an import, which is no more than what it imports."""


@cache
def kernel_key(module: str, name: str) -> str:
    """Return a digest of the code that a function of a module reaches."""
    reached: set[tuple[str, str]] = set()
    waiting: list[tuple[str, str]] = [(module, name)]
    seen = {("", "")}
    while waiting:
        wanted = waiting.pop()
        if wanted in seen:
            continue
        seen.add(wanted)
        module, name = wanted
        statements = _statements(module)
        for statement in statements.get("*", ()) if name == "*" else statements.get(name, ()):
            if statement.digest:
                reached.add((module, statement.digest))
            waiting += [(module, loaded) for loaded in statement.loads]
            for bound, dotted in statement.imports:
                if name in ("*", bound) or not bound:
                    reached.add((module, f"{bound}={dotted}"))
                    waiting.append(_target(dotted))
    return hashlib.sha256(repr(sorted(reached)).encode()).hexdigest()


@cache
def _target(dotted: str) -> tuple[str, str]:
    """Return module and name of an import target: `*` for a whole module, nothing outside the project."""
    if _file(dotted) is not None:
        return dotted, "*"
    module, _, name = dotted.rpartition(".")
    return (module, name) if _file(module) is not None else ("", "")


@cache
def _file(module: str) -> Path | None:
    return _tree().file(module) if module else None


@cache
def _tree() -> SourceTree:
    return SourceTree(_PACKAGES)


@cache
def _statements(module: str) -> dict[str, list[_Statement]]:
    """Return the statements of a module's top level by the names that they bind, and all of them under `*`."""
    file = _file(module)
    if file is None:
        return {}
    named: dict[str, list[_Statement]] = {}
    for statement in _read(file, module if file.name == "__init__.py" else module.rpartition(".")[0]):
        for name in ("*", *statement.binds):
            named.setdefault(name, []).append(statement)
    return named


def _read(file: Path, package: str) -> list[_Statement]:
    """Return the statements of a file, from a note next to Python's compiled files where there is one."""
    source = file.read_bytes()
    key = hashlib.sha256(_own_source() + source).hexdigest()
    note = read_note(str(file), "kernels", key)
    if note is None:
        body = ast.parse(source, file).body
        statements = [statement for node in body if not is_prose(node) for statement in _parsed(node, package)]
        here = {name for statement in statements for name in statement.binds}
        note = {"statements": [item._replace(loads=[n for n in item.loads if n in here]) for item in statements]}
        write_note(str(file), "kernels", key, note)
    return [_Statement(*fields) for fields in note["statements"]]


@cache
def _own_source() -> bytes:
    return Path(__file__).read_bytes()


def _parsed(node: ast.stmt, package: str) -> Iterator[_Statement]:
    """Yield a statement; one that only imports has no digest."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        imports = list(_imports(node, package))
        yield _Statement([bound for bound, _ in imports], [], imports, "")
        return
    inside = list(ast.walk(node))
    names = [item for item in inside if isinstance(item, ast.Name)]
    loads = {item.id for item in names}
    imports = [
        ("" if isinstance(node, ast.FunctionDef | ast.ClassDef) else bound, dotted)
        for item in inside
        if isinstance(item, ast.Import | ast.ImportFrom)
        for bound, dotted in _imports(item, package)
    ]
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        binds = {node.name}
    elif isinstance(node, ast.Expr):  # a call may change its arguments
        binds = loads
    else:
        binds = {item.id for item in names if isinstance(item.ctx, ast.Store)}
        binds |= {item.name for item in inside if isinstance(item, ast.FunctionDef | ast.ClassDef)}
        binds |= {bound for bound, _ in imports}
        binds |= {_root(item) for item in inside if isinstance(item, ast.Subscript | ast.Attribute) and _stores(item)}
    words: list[str] = []
    code_words(node, words.append, [])
    digest = hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]
    yield _Statement(sorted(binds), sorted(loads), imports, digest)


def _imports(node: ast.Import | ast.ImportFrom, package: str) -> Iterator[tuple[str, str]]:
    for alias in node.names:
        if isinstance(node, ast.Import):
            yield alias.asname or alias.name.partition(".")[0], alias.name
        else:
            dotted = f"{node.module or ''}.{alias.name}".lstrip(".")
            yield alias.asname or alias.name, absolute_name((node.level, dotted), package)


def _stores(node: ast.Subscript | ast.Attribute) -> bool:
    return isinstance(node.ctx, ast.Store)


def _root(node: ast.expr) -> str:
    """Return the name at the base of `name.field[index]`."""
    while isinstance(node, ast.Subscript | ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""
