"""Global constraints refuse what no neighbourhood tells, and say why."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.shape.kit import Assembly, Kit
from stages.variations.constraint import made_test, unknown_in
from tests.stages.variations.toy import Placed, box, kit_of, pose

ROOT = Path(__file__).resolve().parents[4]

CHUTE = {
    "top": box(1.0, 0.4, 1.0),
    "slide": box(1.0, 0.4, 0.8),
    "end": box(1.0, 0.4, 0.6),
    "pillar": box(0.2, 1.0, 0.2),
}


def chute() -> list[Placed]:
    """A top on a pillar, two slides each a little lower than the one before, and an end that stands on a pillar too."""
    return [
        ("pillar", pose(0, -0.7, 0)),
        ("top", pose(0, 0, 0)),
        ("slide", pose(1, -0.1, 0)),
        ("slide", pose(2, -0.2, 0)),
        ("end", pose(3, -0.3, 0)),
    ]


@pytest.fixture(scope="module")
def kit() -> Kit:
    return kit_of(CHUTE, [chute()])


LABELS = {"entries": ("top",), "exits": ("end",), "through": ("slide",)}


def changed(assembly: Assembly, part: int, height: float) -> Assembly:
    poses = assembly.poses.copy()
    poses[part, 1, 3] += height
    return replace(assembly, poses=poses)


def place_of(kit: Kit, assembly: Assembly, name: str) -> int:
    return int(np.flatnonzero(assembly.types == kit.type_names().index(name))[0])


def test_an_exemplar_meets_its_constraints(kit: Kit) -> None:
    unmet = made_test(kit, {"support": {}, "path": LABELS})
    assert unmet(kit.exemplars[0].assembly) is None


def test_a_path_must_reach_an_exit_and_never_rise(kit: Kit) -> None:
    unmet = made_test(kit, {"path": LABELS})
    assembly = kit.exemplars[0].assembly
    parts = np.arange(len(assembly))
    end = place_of(kit, assembly, "end")
    slide = place_of(kit, assembly, "slide")
    assert unmet(assembly.select(parts[parts != place_of(kit, assembly, "top")])) == "no entry"
    assert unmet(assembly.select(parts[parts != end])) == "no exit"
    assert unmet(assembly.select(parts[parts != slide])) == "no path from an entry to an exit"
    assert unmet(changed(assembly, slide, 0.3)) == "a path leads upwards"
    assert made_test(kit, {"path": {"entries": ("top",), "exits": ("end",)}})(assembly) is None


def test_labels_that_a_kit_has_not_are_told(kit: Kit) -> None:
    with pytest.raises(ConfigError, match="no parts called slyde; did you mean slide"):
        made_test(kit, {"path": {**LABELS, "through": ("slyde",)}})


def test_what_was_always_borne_must_be(kit: Kit) -> None:
    unmet = made_test(kit, {"support": {}})
    assembly = kit.exemplars[0].assembly
    pillar, top = (place_of(kit, assembly, name) for name in ("pillar", "top"))
    parts = np.arange(len(assembly))
    assert unmet(assembly.select(parts[parts != pillar])) is not None
    assert unmet(changed(assembly, top, 0.2)) == "hangs without support"


def test_a_pillar_that_always_stood_on_the_ground_is_not_lifted(kit: Kit) -> None:
    assembly = kit.exemplars[0].assembly
    pillar = place_of(kit, assembly, "pillar")
    twice = Assembly(
        np.append(assembly.types, assembly.types[pillar]),
        np.concatenate([assembly.poses, changed(assembly, pillar, 0.5).poses[[pillar]]]),
        assembly.edges,
    )
    assert made_test(kit, {"support": {}})(twice) == "lifted off the ground"


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"suport": {}}, "did you mean 'support'"),
        ({"path": {"entries": ("top",)}}, "path needs 'exits'"),
        ({"support": {"entries": ("top",)}}, "support knows no 'entries'"),
    ],
)
def test_what_is_wrong_with_a_constraint_is_told(asked: dict[str, dict[str, tuple[str, ...]]], told: str) -> None:
    assert told in str(unknown_in(asked))
    assert unknown_in({"path": LABELS, "support": {}}) is None


def test_a_constraint_in_a_file_of_the_users_own_is_found_and_its_code_counts(tmp_path: Path) -> None:
    folder = tmp_path / "stages/variations/constraints"
    folder.mkdir(parents=True)
    (folder / "small.py").write_text(
        "from stages.variations.constraint import Constraint\n"
        "CONSTRAINT = Constraint((), (), lambda kit, labels: lambda shape: None if len(shape) < 3 else 'large')\n"
    )
    asked = (
        "from pipeline.code import reached\n"
        "from stages.variations.constraint import find_constraints, module_of\n"
        "print(*find_constraints(), *reached([module_of('small')]))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", asked], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[:3] == ["path", "small", "support"]
    assert any("small" in each for each in done.stdout.split()[3:])
