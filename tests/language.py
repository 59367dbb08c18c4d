"""The rules of language, read from the source: retired words, bare constants, names with two meanings, import circles.

`python -m tests.language [PATH ...]` lists what breaks them in the files under the paths.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = ("pipeline", "stages", "eval", "datasets/exemplars/source")
ABOUT_WORDS = {Path(__file__).resolve(), ROOT / "tests/test_language.py"}
"""Files that name retired words because they look for them."""

_NAME_WORDS = """
    acceptor acceptors anew asker backdrop ballot bared carcass carcasses climb complain docker dockers dream dreamt
    dreaming dreams dull dullness dummies each fewest fooled glance house journal journeys ladder lane lanes look_back
    meanings mill near_twins nucleus per_kit prospect rung rungs seal seals sealed sight spoil spoils spoilt stance
    stances steering strays struck survey telling told unstated walker witness witnesses
"""
RETIRED_IN_NAMES = frozenset(_NAME_WORDS.split())
"""Words that no identifier holds, alone or between underscores; the glossary names the standard term of each."""

RETIRED_IN_PROSE = tuple(
    """
    the mill|mills?|let go|spoilt|spoiled|set aside|dreamt|dreams|dreamed|so many|as many as|of which|that which
    at all|lies upon|lie upon|comes of it|says? so|anew|beside|backdrop|carcass|dockers?|acceptor|near twins?
    made again|once more|what lies between|asker|stances?|to all|hereof|whereof|therein|thereof|oftener
    """.replace("\n", "|").split("|")
)
"""Words and phrases that no comment, docstring, message or page holds."""

_PHRASES = sorted({" ".join(phrase.split()) for phrase in RETIRED_IN_PROSE if phrase.strip()})
_PROSE = re.compile(rf"\b(?:(?i:{'|'.join(_PHRASES)})|(?:[Ii]s|[Aa]re) none)\b")
_WORDS = re.compile(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])")


def files_under(paths: Iterable[Path], suffix: str = ".py") -> list[Path]:
    """Return the files with a suffix under some paths, sorted, but for those about words."""
    found = set()
    for path in paths:
        found |= set(path.rglob(f"*{suffix}")) if path.is_dir() else {path}
    return sorted(
        path for path in found if path not in ABOUT_WORDS and ".venv" not in path.parts and path.suffix == suffix
    )


def product_files() -> list[Path]:
    """Return every Python file of the product."""
    return files_under(ROOT / top for top in PRODUCT)


class Source(NamedTuple):
    """What the rules look at in a Python file. Syntax trees of all files would take gigabytes."""

    names: list[tuple[str, int]]
    """Each name that it binds, with its line: variables, arguments, fields, functions, classes."""
    texts: list[tuple[int, int]]
    """First and last line of each text."""
    imports: list[str]
    """Dotted names of its imports, also inside functions."""
    constants: list[tuple[str, int]]
    """Numeric constants of the module whose name is one word."""
    classes: list[tuple[str, int]]
    """Public classes of the module."""


@cache
def read_source(path: Path) -> Source:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    source = Source([], [], [], list(_bare_constants(tree)), [])
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            if isinstance(node.ctx, ast.Store):
                source.names.append((node.id, node.lineno))
        elif isinstance(node, ast.Constant):
            if isinstance(node.value, str) and node.end_lineno is not None:
                source.texts.append((node.lineno, node.end_lineno))
        elif isinstance(node, ast.arg):
            source.names.append((node.arg, node.lineno))
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            source.names.append((node.name, node.lineno))
        elif isinstance(node, ast.Import):
            source.imports.extend(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            source.imports.extend([node.module, *(f"{node.module}.{alias.name}" for alias in node.names)])
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            source.classes.append((node.name, node.lineno))
    return source


def retired_names(path: Path) -> Iterator[str]:
    """Yield what in a file's names is retired."""
    for word in RETIRED_IN_NAMES & set(path.stem.split("_")):
        yield f"the file's name holds '{word}'"
    for name, line in read_source(path).names:
        words = {word.lower() for word in _WORDS.findall(name)} | {name}
        for word in sorted(words & RETIRED_IN_NAMES):
            yield f"line {line}: {name} holds '{word}'"


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of a file that people read: comments and texts of Python, everything of a page."""
    lines = path.read_text(encoding="utf-8").splitlines()
    if path.suffix != ".py":
        # a page may quote a paper's word
        yield from ((number, re.sub(r'"[^"]*"', "", line)) for number, line in enumerate(lines, 1))
        return
    for first, last in read_source(path).texts:
        yield from ((number, lines[number - 1]) for number in range(first, last + 1))
    yield from ((number, line.partition("#")[2]) for number, line in enumerate(lines, 1) if "#" in line)


def retired_prose(path: Path) -> Iterator[str]:
    """Yield the retired phrases of a file, each once a line."""
    seen = set()
    for number, line in prose(path):
        for match in _PROSE.finditer(line):
            if (number, match.group().lower()) not in seen:
                seen.add((number, match.group().lower()))
                yield f"line {number}: '{match.group()}'"


def _is_number(node: ast.expr | None) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) and _is_number(node.right)
    return False


def bare_constants(path: Path) -> Iterator[str]:
    """Yield the numeric constants of a module whose name is one word, so that it says no quantity."""
    yield from (f"line {line}: {name}" for name, line in read_source(path).constants)


def _bare_constants(tree: ast.Module) -> Iterator[tuple[str, int]]:
    for node in tree.body:
        if isinstance(node, ast.Assign):
            targets, value = node.targets, node.value
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            targets, value = [node.target], node.value
        else:
            continue
        for target in targets:
            pairs = [(target, value)]
            if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                pairs = list(zip(target.elts, value.elts, strict=False))
            for name, number in pairs:
                one_word = isinstance(name, ast.Name) and name.id.isupper() and "_" not in name.id.strip("_")
                if one_word and _is_number(number):
                    yield ast.unparse(name), node.lineno


def public_classes(files: Iterable[Path]) -> dict[str, list[str]]:
    """Return the public classes of some files by name, with where each is defined."""
    found: dict[str, list[str]] = defaultdict(list)
    for path in files:
        for name, line in read_source(path).classes:
            found[name].append(f"{path.relative_to(ROOT)}:{line}")
    return found


def classes_defined_twice(files: Iterable[Path]) -> list[str]:
    """Return the names that more than one public class has."""
    return [f"{name}: {', '.join(places)}" for name, places in sorted(public_classes(files).items()) if len(places) > 1]


def import_circles(files: Iterable[Path]) -> list[str]:
    """Return one circle of imports between files, imports inside functions included, or nothing."""
    modules = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in files}
    reads = {
        module: {name for name in read_source(path).imports if name in modules and name != module}
        for module, path in modules.items()
    }
    try:
        list(TopologicalSorter(reads).static_order())
    except CycleError as error:
        return [" -> ".join(error.args[1])]
    return []


def main(arguments: list[str]) -> int:
    """List what breaks the rules under the given paths; the exit code is 1 where something does."""
    paths = [Path(argument).resolve() for argument in arguments] or [ROOT / top for top in (*PRODUCT, "tests")]
    files = files_under(paths)
    counts: dict[str, int] = {}
    for rule in (retired_names, bare_constants, retired_prose):
        for path in [*files, *(files_under(paths, ".md") if rule is retired_prose else [])]:
            for fault in rule(path):
                counts[rule.__name__] = counts.get(rule.__name__, 0) + 1
                print(f"{path.relative_to(ROOT)}: {fault}")
    shown = {str(path.relative_to(ROOT)) for path in files}
    twice = [line for line in classes_defined_twice(product_files()) if any(name in line for name in shown)]
    circles = import_circles(product_files())
    print(*twice, *circles, sep="\n")
    print(counts | {"classes defined twice": len(twice), "import circles": len(circles)})
    return int(bool(counts or twice or circles))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
