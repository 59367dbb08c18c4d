"""The report: what stands in it, and that it needs nothing but itself; in a real browser where there is one."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from PIL import Image

from eval.engine.chart import chart_svg, ticks
from eval.engine.dataset_run import load_dataset_run
from eval.engine.evaluation import Chart, Figure, ImageRow, TableResult
from eval.engine.report import FinishedTable, report_html
from eval.engine.table import ReferenceRow, Table
from stages.package.manifest import config_sections
from tests.eval.engine.chromium import Browser, browser, find_chromium

ROOT = Path(__file__).resolve().parents[2]
HOSTILE = "<script>alert('castle')</script>"


def png() -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (232, 232), (200, 120, 90)).save(stream, "PNG")
    return stream.getvalue()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with everything that a report may hold, wide tables and long names among it."""
    columns = ("shapes of", *(f"a column of number {number}" for number in range(14)))
    table = Table(
        "A wide table",
        columns,
        tuple((name, *range(1000, 1014)) for name in ("castle", HOSTILE, "a_very_long_name_without_any_room" * 3)),
        ("A note.", "another_note_without_any_room_at_all_" * 6),
        (ReferenceRow("sand castle, naive", "strings Table 2", {columns[1]: 102, columns[2]: 4.71}),),
    )
    line = [(float(x), float(x * x)) for x in range(30)]
    curve = Chart("Growth", "round", "shapes", {f"kit {number} {HOSTILE}": line for number in range(10)})
    strip = ImageRow("Shapes", [(f"shape {number} {HOSTILE}", png()) for number in range(9)])
    answer = TableResult([table], [curve], [strip], [Figure("figure7", f"A sheet {HOSTILE}", png())])
    subject = load_dataset_run(ROOT / "configs" / "default.yaml", tmp_path_factory.mktemp("none"))
    made = [
        FinishedTable("wide_ones", "How wide?", answer, 1.5),
        FinishedTable("small", "How small?", TableResult([Table("S", ("a",), ())]), 0),
    ]
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_html(subject, made, {"strings": "no trained model; make train"}, datetime.now(UTC)))
    return path


def test_report_says_what_was_made_of_what_and_what_was_not(page: Path) -> None:
    text = page.read_text()
    for said in (
        "A wide table",
        "How wide?",
        "Published, strings Table 2",
        "4.71",
        "A sheet",
        "no trained model; make train",
    ):
        assert said in text
    for said in ("cores", "UTC", "seed 1", "Python 3.11", "numpy", "name: shapemill-default"):
        assert said in text, "how it was made"


def test_report_tells_of_a_config_that_was_edited_after_the_dataset_was_made(tmp_path: Path) -> None:
    subject = load_dataset_run(ROOT / "configs" / "default.yaml", tmp_path)
    subject.folder.mkdir()
    sections = json.loads(json.dumps(config_sections(subject.config)))
    facts = {"name": "d", "version": "1.0.0", "seed": 1, "samples": 3, "kits": {"castle": 3}, "splits": {"train": 3}}
    for edges, told in (("all", False), ("tree", True)):
        sections["strings"]["edges"] = edges
        manifest = {**facts, "made_with": {"shapemill": "0.1.0+abc"}, "config": sections}
        (subject.folder / "manifest.json").write_text(json.dumps(manifest))
        page = report_html(load_dataset_run(subject.config.path, tmp_path), [], {}, datetime.now(UTC))
        assert ("say something else now: strings" in page) == told
        assert "3 shapes, 3 of castle" in page


def test_whatever_is_told_stands_there_as_text(page: Path) -> None:
    text = page.read_text()
    assert HOSTILE not in text
    assert text.count("&lt;script&gt;") >= 20


def test_report_refers_to_nothing_outside(page: Path) -> None:
    addresses = re.findall(r'(?:src|href)="([^"]*)"|url\(([^)]*)\)', page.read_text())
    assert {one or other for one, other in addresses if not (one or other).startswith(("data:", "#"))} == set()


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0, 100, [0, 20, 40, 60, 80, 100]), (0.1, 0.7, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]), (-1, 4, [-1, 0, 1, 2, 3, 4])],
)
def test_ticks_are_round_and_hold_what_is_shown(low: float, high: float, expected: list[float]) -> None:
    assert ticks(low, high) == pytest.approx(expected)


def test_ticks_of_one_value_have_room_around_it() -> None:
    assert ticks(3, 3)[0] < 3 < ticks(3, 3)[-1]


def test_points_lie_where_their_ticks_are() -> None:
    svg = chart_svg(Chart("c", "x", "y", {"line": [(0.0, 0.0), (10.0, 100.0)]}))
    (first, last) = re.search(r'points="(\S+) (\S+)"', svg).groups()  # type: ignore[union-attr]
    labels = dict(re.findall(r'<text x="([\d.]+)" y="[\d.]+" text-anchor="middle">(\d+)<', svg))
    assert (labels[first.split(",")[0]], labels[last.split(",")[0]]) == ("0", "10")
    grid = re.findall(r'class="grid"[^>]*y1="([\d.]+)"', svg)
    assert (first.split(",")[1], last.split(",")[1]) == (grid[0], grid[-1])


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    program = find_chromium()
    if program is None:
        pytest.skip("no Chromium on this machine")
    with browser(program, tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 1280])
def test_in_a_browser_nothing_overflows_nothing_is_fetched_and_nothing_is_complained_of(
    page: Path, tab: Browser, width: int, scheme: str
) -> None:
    tab.show(page, width, scheme)
    assert tab.value("innerWidth") == width
    assert tab.value("document.documentElement.scrollWidth") <= width
    asked = [each["request"]["url"] for each in tab.told("Network.requestWillBeSent")]
    assert [each for each in asked if not each.startswith("data:")] == [page.resolve().as_uri()]
    assert not tab.told("Log.entryAdded")
    assert not tab.told("Runtime.consoleAPICalled")
    assert not tab.told("Runtime.exceptionThrown")
    assert tab.value("[...document.images].every(each => each.naturalWidth == 232)")
    paper = re.findall(r"\d+", tab.value("getComputedStyle(document.body).backgroundColor"))
    assert all(int(each) < 64 if scheme == "dark" else int(each) > 192 for each in paper)


def test_the_browser_would_tell_of_what_a_page_fetches_says_and_lets_overflow(tmp_path: Path, tab: Browser) -> None:
    page = tmp_path / "page.html"
    page.write_text('<img src="none.png"><div style="width:2000px">w</div><script>console.log("said")</script>')
    tab.show(page, 360, "light")
    assert tab.value("document.documentElement.scrollWidth") > 360
    assert len(tab.told("Network.requestWillBeSent")) == 2
    assert tab.told("Runtime.consoleAPICalled")
    assert tab.told("Log.entryAdded")
