"""The text member that stage `strings` adds to samples with shape graphs, and the corpus on the card."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.config import Config
from pipeline.stage import Plan
from stages.shape.collection.members import TEXT, Member, Members
from stages.strings.settings import EDGE_DESCRIPTIONS, StringsConfig

CORPUS = "corpus"
"""Name of the shard of the corpus, and stem of its files."""

COLUMNS = (
    ("tokens", "tokens a string"),
    ("cycles", "cycle numbers a string"),
    ("cycle_rank", "cycle rank of a shape"),
)


def _text(config: Config) -> tuple[Member, ...]:
    section = config.section(StringsConfig)
    if not section.enabled:
        return ()
    edges = section.edges
    kind = {"all": "", "faces": " by its face contacts", "tree": " without the contacts that close cycles"}[edges]
    return (Member(TEXT, f"Its shape graph{kind} as strings, SMILES-like, one a line, the first canonical."),)


def _card(plan: Plan) -> Sequence[str]:
    """Return what a string encodes, and how long strings are."""
    summary = plan.summary("strings", CORPUS)
    if summary is None:
        return []
    rows = ["| strings of | " + " | ".join(title for _, title in COLUMNS) + " |", "|---|" + "---:|" * len(COLUMNS)]
    for kit, figures in summary["kits"].items():
        cells = [f"{figures[name]['median']:,}, at most {figures[name]['most']:,}" for name, _ in COLUMNS]
        rows.append(f"| {kit} | " + " | ".join(cells) + " |")
    return [f"{EDGE_DESCRIPTIONS[summary['edges']]} Medians of the corpus:", "\n".join(rows)]


MEMBERS = Members(of=_text, card=_card)
