"""Names and prose follow the glossary of `stages/README.md`."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.language import (
    ROOT,
    bare_constants,
    classes_defined_twice,
    files_under,
    import_circles,
    product_files,
    retired_names,
    retired_prose,
)


def python_files() -> list[Path]:
    return sorted({*product_files(), *files_under([ROOT / "tests", ROOT / "changes"])})


def pages() -> list[Path]:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    return [ROOT / name for name in names if (ROOT / name).exists()]


def faults(rule: Callable[[Path], Iterator[str]], files: list[Path]) -> list[str]:
    return [f"{path.relative_to(ROOT)}: {fault}" for path in files for fault in rule(path)]


def test_no_name_holds_a_retired_word() -> None:
    assert faults(retired_names, python_files()) == []


def test_no_comment_docstring_message_or_page_holds_a_retired_phrase() -> None:
    assert faults(retired_prose, [*python_files(), *pages()]) == []


def test_numeric_constants_name_their_quantity() -> None:
    assert faults(bare_constants, python_files()) == []


def test_public_class_names_are_unique() -> None:
    assert classes_defined_twice(product_files()) == []


def test_files_do_not_import_each_other_in_a_circle() -> None:
    assert import_circles(product_files()) == []


@pytest.mark.parametrize(
    ("source", "rule", "count"),
    [
        ("for each in range(3):\n    print(each)\n", retired_names, 1),
        ("def climb_ladder(told_why):\n    pass\n", retired_names, 3),
        ("MOST = 3\nMAX_LABELS = 3\n_NEAR = -0.5\nWORDS = 'a b'\nLOW, HIGH = 1, 2\n", bare_constants, 4),
        ('"""So many parts, of which none is None."""\n# made anew\n', retired_prose, 3),
        ('x = None\nprint(f"{x is None}")\n', retired_prose, 0),
    ],
)
def test_rules_find_what_they_are_for(
    tmp_path: Path, source: str, rule: Callable[[Path], Iterator[str]], count: int
) -> None:
    path = tmp_path / "example.py"
    path.write_text(source, encoding="utf-8")
    assert len(list(rule(path))) == count
