"""The report is complete and self-contained, also in a real browser if there is one."""

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

ROOT = Path(__file__).resolve().parents[3]
HOSTILE = "<script>alert('castle')</script>"


def png() -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (232, 232), (200, 120, 90)).save(stream, "PNG")
    return stream.getvalue()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a report with all kinds of content, also wide tables and long names."""
    columns = ("shapes of", *(f"a column of number {number}" for number in range(14)))
    table = Table(
        "A wide table",
        columns,
        tuple((name, *range(1000, 1014)) for name in ("castle", HOSTILE, "a_very_long_name_without_any_room" * 3)),
        ("A note.", "another_note_without_any_room_at_all_" * 6),
        (ReferenceRow("sand castle, naive", "strings Table 2", {columns[1]: 102, columns[2]: 4.71}),),
    )
    line = [(float(x), float(x * x)) for x in range(30)]
    chart = Chart("Growth", "round", "shapes", {f"kit {number} {HOSTILE}": line for number in range(10)})
    image_row = ImageRow("Shapes", [(f"shape {number} {HOSTILE}", png()) for number in range(9)])
    result = TableResult([table], [chart], [image_row], [Figure("figure7", f"A figure {HOSTILE}", png())])
    run = load_dataset_run(ROOT / "configs" / "default.yaml", tmp_path_factory.mktemp("none"))
    finished = [
        FinishedTable("wide_ones", "How wide?", result, 1.5),
        FinishedTable("small", "How small?", TableResult([Table("S", ("a",), ())]), 0),
    ]
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(
        report_html(run, finished, {"strings": "no trained model; make train"}, datetime.now(UTC)), encoding="utf-8"
    )
    return path


def test_report_shows_tables_their_origin_and_what_is_missing(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for shown in (
        "A wide table",
        "How wide?",
        "Published, strings Table 2",
        "4.71",
        "A figure",
        "no trained model; make train",
    ):
        assert shown in text
    for shown in ("cores", "UTC", "seed 1", "Python 3.11", "numpy", "name: shapemill-default"):
        assert shown in text, "how it was made"


def test_report_names_config_sections_changed_since_the_dataset(tmp_path: Path) -> None:
    run = load_dataset_run(ROOT / "configs" / "default.yaml", tmp_path)
    run.folder.mkdir()
    sections = json.loads(json.dumps(config_sections(run.config)))
    facts = {"name": "d", "version": "1.0.0", "seed": 1, "samples": 3, "kits": {"castle": 3}, "splits": {"train": 3}}
    for edges, is_changed in (("all", False), ("tree", True)):
        sections["strings"]["edges"] = edges
        manifest = {**facts, "software": {"shapemill": "0.1.0+abc"}, "config": sections}
        (run.folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
        page = report_html(load_dataset_run(run.config.path, tmp_path), [], {}, datetime.now(UTC))
        assert ("Changed since then" in page and "sections of the config: strings" in page) == is_changed
        assert "3 shapes, 3 of castle" in page


def test_report_escapes_all_texts(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert HOSTILE not in text
    assert text.count("&lt;script&gt;") >= 20


def test_report_has_no_external_references(page: Path) -> None:
    matches = re.findall(r'(?:src|href)="([^"]*)"|url\(([^)]*)\)', page.read_text(encoding="utf-8"))
    assert {first or second for first, second in matches if not (first or second).startswith(("data:", "#"))} == set()


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0, 100, [0, 20, 40, 60, 80, 100]), (0.1, 0.7, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]), (-1, 4, [-1, 0, 1, 2, 3, 4])],
)
def test_ticks_are_round_and_cover_the_range(low: float, high: float, expected: list[float]) -> None:
    assert ticks(low, high) == pytest.approx(expected)


def test_ticks_of_one_value_have_room_around_it() -> None:
    assert ticks(3, 3)[0] < 3 < ticks(3, 3)[-1]


def test_points_align_with_their_ticks() -> None:
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
def test_page_in_browser_has_no_overflow_requests_or_errors(page: Path, tab: Browser, width: int, scheme: str) -> None:
    tab.show(page, width, scheme)
    assert tab.value("innerWidth") == width
    assert tab.value("document.documentElement.scrollWidth") <= width
    urls = [event["request"]["url"] for event in tab.events_of("Network.requestWillBeSent")]
    assert [url for url in urls if not url.startswith("data:")] == [page.resolve().as_uri()]
    assert not tab.events_of("Log.entryAdded")
    assert not tab.events_of("Runtime.consoleAPICalled")
    assert not tab.events_of("Runtime.exceptionThrown")
    assert tab.value("[...document.images].every(image => image.naturalWidth == 232)")
    paper = re.findall(r"\d+", tab.value("getComputedStyle(document.body).backgroundColor"))
    assert all(int(value) < 64 if scheme == "dark" else int(value) > 192 for value in paper)


def test_browser_reports_requests_messages_and_overflow(tmp_path: Path, tab: Browser) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        '<img src="none.png"><div style="width:2000px">w</div><script>console.log("said")</script>', encoding="utf-8"
    )
    tab.show(page, 360, "light")
    assert tab.value("document.documentElement.scrollWidth") > 360
    assert len(tab.events_of("Network.requestWillBeSent")) == 2
    assert tab.events_of("Runtime.consoleAPICalled")
    assert tab.events_of("Log.entryAdded")
