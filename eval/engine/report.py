"""The report: every table about one dataset in one page that needs nothing but itself.

The page is a jinja2 template with autoescape: what a config, a kit or a model file calls itself is text there, never
markup. A Content-Security-Policy in the page forbids it to load anything.
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
    """A table that was made. seconds: how long it took."""

    name: str
    question: str
    answer: TableResult
    seconds: float


def report_html(subject: DatasetRun, made: Sequence[FinishedTable], unmade: Mapping[str, str], began: datetime) -> str:
    """The page. unmade: why, of the tables that were not made, by their names; began: when work on the first began."""
    house = Environment(
        loader=FileSystemLoader(TEMPLATE.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    house.filters["figure"] = cell_text
    config = subject.config
    return house.get_template(TEMPLATE.name).render(
        title=config.title,
        subtitle=_subtitle(subject),
        made=[_shown(each) for each in made],
        unmade=list(unmade.items()),
        facts=_facts(subject, began),
        libraries=list(library_versions().items()),
        config=config.path.read_text(),
        colors=NUM_COLORS,
    )


def _shown(made: FinishedTable) -> Mapping[str, object]:
    answer = made.answer
    curves = [each for each in answer.curves if any(each.lines.values())]
    return {
        "name": made.name,
        "question": made.question,
        "answer": answer,
        "seconds": made.seconds,
        "charts": [(each, Markup(chart_svg(each))) for each in curves],
        "strips": [
            {"title": each.title, "pictures": [(caption, _inlined(png)) for caption, png in each.pictures]}
            for each in answer.strips
            if each.pictures
        ],
        "sheets": [(each.title, _inlined(each.picture)) for each in answer.sheets],
    }


def _inlined(png: bytes) -> str:
    return f"data:image/png;base64,{b64encode(png).decode()}"


def _subtitle(subject: DatasetRun) -> str:
    described = subject.manifest
    if not described:
        return f"{subject.config.name}: no finished dataset yet"
    kits = ", ".join(f"{count:,} of {kit}" for kit, count in described["kits"].items())
    return f"{described['name']} {described['version']}: {described['samples']:,} shapes, {kits}"


def _changed_sections(subject: DatasetRun) -> list[str]:
    """The sections of the config that differ from those that the dataset was made with."""
    said = json.loads(json.dumps(config_sections(subject.config)))
    made = subject.manifest.get("config", {})
    return [name for name, section in said.items() if name in made and made[name] != section]


def _facts(subject: DatasetRun, began: datetime) -> list[tuple[str, str]]:
    """What was run, when and on what."""
    described = subject.manifest
    facts = [("Tables made", f"{began:%Y-%m-%d %H:%M} to {datetime.now(UTC):%H:%M} UTC")]
    facts.append(("Code", f"shapemill {code_version(tables)}, Python {platform.python_version()}"))
    facts.append(("Machine", f"{os.cpu_count()} cores, {platform.machine()}, {sys.platform}"))
    facts.append(("Config", f"{subject.config.path}, seed {subject.config.seed}"))
    if described:
        made_with = described["made_with"]["shapemill"]
        facts.append(("Dataset", f"{described['name']} {described['version']}, seed {described['seed']}"))
        facts.append(("Dataset made by", f"shapemill {made_with}"))
        changed = _changed_sections(subject)
        if changed:
            told = f"sections of the config that say something else now: {', '.join(changed)}"
            facts.append(("Not as it was made", told))
        facts.append(("Splits", ", ".join(f"{split} {count:,}" for split, count in described["splits"].items())))
    return facts
