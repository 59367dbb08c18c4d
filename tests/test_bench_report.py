from __future__ import annotations

import json

from tests.bench.kept import change, figures, keep, row
from tests.bench.measure import Measure


def test_report_marks_changes_beyond_noise(tmp_path):
    path = tmp_path / "report.json"
    assert figures(path) == {}
    keep(
        path,
        [Measure("slower", "samples", 10.0), Measure("alike", "samples", 10.0), Measure("faster", "samples", 10.0)],
    )
    assert "**" not in path.with_suffix(".md").read_text(encoding="utf-8")
    now = [Measure("slower", "samples", 7.0), Measure("alike", "samples", 9.0), Measure("faster", "samples", 14.0)]
    kept = figures(path)
    assert [change(item, kept) for item in now] == ["**-30%**", "-10%", "**+40%**"]
    assert change(Measure("other", "samples", 1.0), kept) == "new"
    keep(path, now)
    text = path.with_suffix(".md").read_text(encoding="utf-8")
    assert row(now[0], kept) in text.splitlines()
    said = json.loads(path.read_text(encoding="utf-8"))
    assert (said["cores"] >= 1, said["memory_gb"] >= 1, figures(path)) == (
        True,
        True,
        {"slower": 7.0, "alike": 9.0, "faster": 14.0},
    )
    assert said["date"] in text
