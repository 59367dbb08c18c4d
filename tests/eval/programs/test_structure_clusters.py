"""Clusters of one structure (shapeassembly figure 10)."""

from __future__ import annotations

from pathlib import Path

from eval.programs.structure_clusters import captured_shares, clusters
from stages.shapeassembly.syntax.parser import parse

PROGRAMS = sorted((Path(__file__).resolve().parents[3] / "datasets/exemplars/programs").glob("*.txt"))


def test_most_frequent_structures_capture_first() -> None:
    assert captured_shares(["a", "b", "a", "c"]) == [50, 75, 100]


def test_copies_with_other_numbers_share_a_structure_and_parts_share_more() -> None:
    programs = [parse(path.read_text(encoding="utf-8")) for path in PROGRAMS]
    doubled = [*programs, *programs]
    table, (shapes, parts) = clusters({"furniture": doubled})
    by_name = {str(row[0]): row[1:] for row in table.rows}
    count, structures, largest, *needed = by_name["furniture, shapes"]
    assert (count, structures, largest) == (len(doubled), len(programs), 100 * 2 / len(doubled))
    assert needed == [-(-len(programs) // 2), -(-len(programs) * 9 // 10)]
    assert by_name["furniture, parts"][0] == 2 * sum(len(program.blocks) for program in programs)
    assert shapes.lines["furniture"][0] == (0, 0)
    assert shapes.lines["furniture"][-1] == (len(programs), 100)
    assert parts.lines["furniture"][-1][1] == 100
