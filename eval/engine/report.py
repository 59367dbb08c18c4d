"""Reports: tables and figures in one self-contained HTML page, such as all tables of one dataset.

The page is a jinja2 template with autoescape, so names from configs, kits and model files are never markup. Its
Content-Security-Policy forbids it to load anything.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

import eval as tables
from eval.engine.chart import NUM_COLORS, chart_svg
from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import TableResult
from eval.engine.table import cell_text
from stages.package.manifest import config_sections
from stages.package.versions import code_version, library_versions

TEMPLATE = Path(__file__).with_suffix(".html")


@dataclass(frozen=True)
class FinishedTable:
    """A table that was made."""

    name: str
    question: str
    result: TableResult
    seconds: float
    """That it took; 0 where the page does not show it."""


def report_html(
    run: DatasetRun, finished: Sequence[FinishedTable], unmade: Mapping[str, str], started: datetime
) -> str:
    """Return the report of a dataset. `unmade`: the reason for each table that was not made, by name."""
    configs = [("Config", run.config.path.read_text(encoding="utf-8"))]
    return page_html(run.config.title, _subtitle(run), finished, unmade, _facts(run, started), configs)


def page_html(
    title: str,
    subtitle: str,
    finished: Sequence[FinishedTable],
    unmade: Mapping[str, str],
    facts: Sequence[tuple[str, str]],
    configs: Sequence[tuple[str, str]],
) -> str:
    """Return a page of tables.

    unmade: the reason for each table that was not made, by name
    facts: what was run, when and on what, as names and texts
    configs: names and texts of the configs
    """
    environment = Environment(
        loader=FileSystemLoader(TEMPLATE.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters["cell"] = cell_text
    return environment.get_template(TEMPLATE.name).render(
        title=title,
        subtitle=subtitle,
        finished=[_section(table) for table in finished],
        unmade=list(unmade.items()),
        facts=facts,
        libraries=list(library_versions().items()),
        configs=configs,
        colors=NUM_COLORS,
    )


def _section(table: FinishedTable) -> Mapping[str, object]:
    result = table.result
    return {
        "name": table.name,
        "question": table.question,
        "tables": result.tables,
        "seconds": table.seconds,
        "printed": result.printed,
        "charts": [(chart, Markup(chart_svg(chart))) for chart in result.charts if any(chart.lines.values())],
        "image_rows": [
            (row.title, [(caption, _data_url(png)) for caption, png in row.pictures])
            for row in result.image_rows
            if row.pictures
        ],
        "figures": [(figure.title, _data_url(figure.png)) for figure in result.figures],
    }


def _data_url(png: bytes) -> str:
    return f"data:image/png;base64,{b64encode(png).decode()}"


def _subtitle(run: DatasetRun) -> str:
    manifest = run.manifest
    if not manifest:
        return f"{run.config.name}: no finished dataset yet"
    kits = ", ".join(f"{count:,} of {kit}" for kit, count in manifest["kits"].items())
    return f"{manifest['name']} {manifest['version']}: {manifest['samples']:,} shapes, {kits}"


def _changed_sections(run: DatasetRun) -> list[str]:
    """Return the sections of the config that differ from those of the finished dataset."""
    sections = json.loads(json.dumps(config_sections(run.config)))
    before = run.manifest.get("config", {})
    return [name for name, section in sections.items() if name in before and before[name] != section]


def machine_facts(started: datetime) -> list[tuple[str, str]]:
    """Return when tables were made, with which code and on which machine."""
    return [
        ("Tables made", f"{started:%Y-%m-%d %H:%M} to {datetime.now(UTC):%H:%M} UTC"),
        ("Code", f"shapemill {code_version(tables)}, Python {platform.python_version()}"),
        ("Machine", f"{os.cpu_count()} cores, {platform.machine()}, {sys.platform}"),
    ]


def _facts(run: DatasetRun, started: datetime) -> list[tuple[str, str]]:
    """Return what was run, when and on what."""
    manifest = run.manifest
    facts = [
        *machine_facts(started),
        ("Config", f"{run.config.path}, seed {run.config.seed}"),
    ]
    if manifest:
        version = manifest["software"]["shapemill"]
        facts.append(("Dataset", f"{manifest['name']} {manifest['version']}, seed {manifest['seed']}"))
        facts.append(("Dataset made by", f"shapemill {version}"))
        changed = _changed_sections(run)
        if changed:
            facts.append(("Changed since then", f"sections of the config: {', '.join(changed)}"))
        facts.append(("Splits", ", ".join(f"{split} {count:,}" for split, count in manifest["splits"].items())))
    return facts
