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
from stages.shape.stretch import moved_by
from stages.variations.constraint import build_repair, build_test, unknown_in
from stages.variations.requirements.resizing import heights_of, spans_of
from tests.stages.variations.substructures.test_replacing import replaced
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose

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


def test_exemplar_meets_its_constraints(kit: Kit) -> None:
    unmet = build_test(kit, {"support": {}, "path": LABELS})
    assert unmet(kit.exemplars[0].assembly) is None


def test_a_path_must_reach_an_exit_and_never_rise(kit: Kit) -> None:
    unmet = build_test(kit, {"path": LABELS})
    assembly = kit.exemplars[0].assembly
    parts = np.arange(len(assembly))
    end = place_of(kit, assembly, "end")
    slide = place_of(kit, assembly, "slide")
    assert unmet(assembly.select(parts[parts != place_of(kit, assembly, "top")])) == "no entry"
    assert unmet(assembly.select(parts[parts != end])) == "no exit"
    assert unmet(assembly.select(parts[parts != slide])) == "no path from an entry to an exit"
    assert unmet(changed(assembly, slide, 0.3)) == "a path leads upwards"
    assert build_test(kit, {"path": {"entries": ("top",), "exits": ("end",)}})(assembly) is None


def test_unknown_labels_are_reported(kit: Kit) -> None:
    with pytest.raises(ConfigError, match="no parts called slyde; did you mean slide"):
        build_test(kit, {"path": {**LABELS, "through": ("slyde",)}})


def test_parts_that_were_always_supported_must_be(kit: Kit) -> None:
    unmet = build_test(kit, {"support": {}})
    assembly = kit.exemplars[0].assembly
    pillar, top = (place_of(kit, assembly, name) for name in ("pillar", "top"))
    parts = np.arange(len(assembly))
    assert unmet(assembly.select(parts[parts != pillar])) is not None
    assert unmet(changed(assembly, top, 0.2)) == "hangs without support"


def test_grounded_pillar_is_not_lifted(kit: Kit) -> None:
    assembly = kit.exemplars[0].assembly
    pillar = place_of(kit, assembly, "pillar")
    twice = Assembly(
        np.append(assembly.types, assembly.types[pillar]),
        np.concatenate([assembly.poses, changed(assembly, pillar, 0.5).poses[[pillar]]]),
        assembly.edges,
    )
    assert build_test(kit, {"support": {}})(twice) == "lifted off the ground"


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        ({"suport": {}}, "did you mean 'support'"),
        ({"path": {"entries": ("top",)}}, "path needs 'exits'"),
        ({"support": {"entries": ("top",)}}, "support knows no 'entries'"),
    ],
)
def test_faults_of_a_constraint_are_reported(asked: dict[str, dict[str, tuple[str, ...]]], fault: str) -> None:
    assert fault in str(unknown_in(asked))
    assert unknown_in({"path": LABELS, "support": {}}) is None


def test_user_constraint_is_found_and_its_code_counts(tmp_path: Path) -> None:
    folder = tmp_path / "stages/variations/constraints"
    folder.mkdir(parents=True)
    (folder / "small.py").write_text(
        "from stages.variations.constraint import GlobalConstraint\n"
        "CONSTRAINT = GlobalConstraint("
        "(), (), lambda kit, labels: lambda shape: None if len(shape) < 3 else 'large')\n",
        encoding="utf-8",
    )
    asked = (
        "from pipeline.code import transitive_imports\n"
        "from stages.variations.constraint import find_constraints, module_of\n"
        "print(*find_constraints(), *transitive_imports([module_of('small')]))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", asked], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[:3] == ["path", "small", "support"]
    assert any("small" in entry for entry in done.stdout.split()[3:])


def dropped(kit: Kit, *, bump: float = 0.0, lift: float = 0.0) -> Assembly:
    """The chute with its second slide so much higher, and all that has no pillar below it lifted; it still touches."""
    assembly = kit.exemplars[0].assembly
    poses = assembly.poses.copy()
    slides = np.flatnonzero(assembly.types == kit.type_names().index("slide"))
    poses[slides[assembly.poses[slides, 0, 3] > 1.5], 1, 3] += bump
    poses[place_of(kit, assembly, "end"), 1, 3] += lift
    return replace(assembly, poses=poses)


def test_rising_path_is_lowered_with_attached_parts(kit: Kit) -> None:
    asked = {"path": LABELS}
    risen = dropped(kit, bump=0.15)
    assert build_test(kit, asked)(risen) == "a path leads upwards"
    mended = build_repair(kit, asked, 3.0, ())(risen)
    assert mended is not None
    assert build_test(kit, asked)(mended) is None
    assert mended.stretches is not None
    bent = np.flatnonzero(np.abs(mended.stretches - np.eye(3)).max(axis=(1, 2)) > 1e-6)
    assert [kit.type_names()[part_type] for part_type in mended.types[bent]] == ["slide"]
    heights = heights_of(kit, mended)
    others = [place for place in range(len(mended)) if place not in bent]
    kept = [place for place in others if kit.type_names()[mended.types[place]] != "end"]
    np.testing.assert_allclose(heights[kept], heights_of(kit, risen)[kept], atol=1e-9)
    assert build_repair(kit, asked, 1.05, ())(risen) is None
    assert build_repair(kit, asked, 3.0, ("slide",))(risen) is None


def test_exit_above_the_ground_is_lowered_along_its_path(kit: Kit) -> None:
    """The end always stood on the ground here; one that hangs over it is reached by its slides, which grow taller."""
    low = kit_of(CHUTE, [[("top", pose(0, 0, 0)), ("slide", pose(1, -0.1, 0)), ("end", pose(2, -0.2, 0))]])
    assembly = low.exemplars[0].assembly
    poses = np.concatenate([assembly.poses, pose(0, -0.2, 3)[None]])
    hung = Assembly(np.append(assembly.types, assembly.types[place_of(low, assembly, "end")]), poses, assembly.edges)
    hung.poses[-1, 1, 3] -= 0.3
    asked = {"path": {**LABELS, "entries": ("top",)}}
    mended = build_repair(low, asked, 3.0, ())(hung)
    assert mended is not None
    end = place_of(low, assembly, "end")
    spans = spans_of(low, mended)
    assert spans[end, 0] == pytest.approx(spans[:, 0].min(), abs=low.contact_tolerance)
    assert spans_of(low, hung)[end, 0] == pytest.approx(spans[:, 0].min() + 0.3)


def test_leg_is_extended_to_the_ground(kit: Kit) -> None:
    legs = {"plate": box(4, 0.2, 1), "leg": box(0.2, 1.0, 0.2), "step": box(1, 0.5, 1)}
    standing = [("plate", pose(0, 1.1, 0)), ("leg", pose(-1.5, 0.5, 0)), ("leg", pose(1.5, 0.5, 0))]
    table = kit_of(legs, [standing])
    assembly = table.exemplars[0].assembly
    short = assembly.poses.copy()
    leg = int(np.flatnonzero((assembly.types == table.type_names().index("leg")) & (short[:, 0, 3] > 0))[0])
    lower = place_of(table, assembly, "leg")
    lower = lower if lower != leg else lower + 1
    plate = place_of(table, assembly, "plate")
    short[[leg, plate], 1, 3] += 0.4
    uneven = moved_leg(replace(assembly, poses=short), lower, 1.4)
    asked: dict[str, dict[str, tuple[str, ...]]] = {"support": {}}
    assert build_test(table, asked)(uneven) == "lifted off the ground"
    mended = build_repair(table, asked, 1.5, ())(uneven)
    assert mended is not None
    np.testing.assert_allclose(spans_of(table, mended)[[leg, lower]], [[0, 1.4], [0, 1.4]], atol=1e-9)
    assert build_repair(table, asked, 1.3, ())(uneven) is None
    with pytest.raises(ConfigError, match="no parts called legg; did you mean leg"):
        build_repair(table, asked, 1.5, ("legg",))


def moved_leg(assembly: Assembly, part: int, factor: float) -> Assembly:
    """Return the assembly with one part scaled in height by a factor, from its lowest point."""
    motions = np.tile(np.eye(4), (len(assembly), 1, 1))
    motions[part, 1, 1] = factor
    return moved_by(assembly, motions)


SUPPORT: dict[str, dict[str, tuple[str, ...]]] = {"support": {}}
TOWERS = {
    "deck": box(1.0, 1.0, 1.0),
    "bridge": box(1.0, 0.2, 0.6),
    "plinth": box(1.0, 0.8, 1.0),
    "kerb": box(1.0, 0.5, 1.0),
    "roof": box(0.8, 0.4, 0.8),
    "tank": box(0.6, 0.6, 0.6),
}


def towers(foot: str, *tops: str) -> list[Placed]:
    """Decks in a row, each on a foot and with something on top, joined by bridges; decks are level."""
    parts = list[Placed]()
    for place, top in enumerate(tops):
        low, high = TOWERS[foot].extents[1] / 2, TOWERS[top].extents[1] / 2
        parts += [("deck", pose(2 * place, 0, 0)), (foot, pose(2 * place, -0.5 - low, 0))]
        parts.append((top, pose(2 * place, 0.5 + high, 0)))
        parts += [("bridge", pose(2 * place - 1, 0, 0))] if place else []
    return parts


def test_towers_with_mixed_feet_are_rejected_or_resized() -> None:
    kit = kit_of(
        TOWERS, [towers("plinth", "roof", "tank", "roof"), towers("kerb", "tank", "roof")], grammar="count_and_pairs"
    )
    _, found = replaced(kit, 400, stretch={"max_factor": 2.0})
    unmet, mend, less = (
        build_test(kit, SUPPORT),
        build_repair(kit, SUPPORT, 2.0, ()),
        build_repair(kit, SUPPORT, 1.5, ()),
    )
    lifted = [variant.assembly for variant in found if unmet(variant.assembly) == "lifted off the ground"]
    assert 0 < len(lifted) < len(found)
    kerb = kit.type_names().index("kerb")
    mended = [made for made in map(mend, lifted) if made is not None]
    assert mended
    assert not any(map(less, lifted))
    for shape in mended:
        spans, feet = spans_of(kit, shape), np.isin(shape.types, [kerb, kit.type_names().index("plinth")])
        assert np.ptp(spans[feet, 0]) < kit.contact_tolerance
        assert np.ptp(spans[shape.types == kerb], axis=1).max() == pytest.approx(0.8, abs=kit.contact_tolerance)
