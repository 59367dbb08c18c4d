"""What is observed in model files, as JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from stages.autoconfig.resolve import ResolvedContacts
from stages.exemplars.build import Observation
from stages.exemplars.diagnostics import connected_pieces, hub_parts, mirror_twins
from stages.exemplars.identify import IdentifiedParts
from stages.exemplars.model import Model
from stages.exemplars.settings import KitConfig
from stages.shape.kit import ContactKind
from stages.shape.kit_files import kit_json

MAX_TYPES_SHOWN = 40
MAX_PIECES_SHOWN = 8
MAX_TYPES_NAMED = 6
CONTACT_WORDS: Mapping[ContactKind, str] = {"face": "over a face", "line": "along a line", "point": "in a point"}


def describe_observation(observation: Observation, models: Sequence[Model], config: KitConfig) -> dict[str, Any]:
    """Return what was observed in models, as JSON.

    The keys of one model are `parts` (name and type, in the order of the file), `contacts` (those that count, pairs
    i < j of indices into `parts`, sorted), `contact_kinds` (every contact with its kind), `pieces`, `hubs` and
    `segmentation`. For several models, `models` lists one such object for each. The keys `types`, `mirror_twins`,
    `neighbourhoods`, `dockings`, `tolerance`, `repairs` and `warnings` hold what the models share.
    """
    kit = observation.kit
    names = kit.type_names()
    counts = np.bincount(np.concatenate([exemplar.assembly.types for exemplar in kit.exemplars]), minlength=len(names))
    described = kit_json(kit)
    shared = {
        "types": [
            {"name": kind.name, "count": int(count), "triangles": len(kind.faces), "symmetries": len(kind.symmetries)}
            for kind, count in zip(kit.types, counts, strict=True)
        ],
        "mirror_twins": [[names[i], names[j]] for i, j in mirror_twins(kit.types, config.congruence_tolerance)],
        "neighbourhoods": described["neighbourhoods"],
        "dockings": described["dockings"],
        "tolerance": kit.contact_tolerance,
        "repairs": dict(observation.repairs),
        "warnings": [*observation.refusals, *observation.warnings],
    }
    described_models = [_describe_model(observation, index, model) for index, model in enumerate(models)]
    return {**described_models[0], **shared} if len(models) == 1 else {"models": described_models, **shared}


def _describe_model(observation: Observation, index: int, model: Model) -> dict[str, Any]:
    exemplar = observation.kit.exemplars[index]
    assembly, names = exemplar.assembly, exemplar.part_names
    piece = connected_pieces(assembly)
    degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly)).tolist()
    return {
        "model": str(model.path),
        "segmentation": {"parts": model.segmentation, "why": model.why},
        "parts": [
            {"name": name, "type": observation.kit.types[kind].name}
            for name, kind in zip(names, assembly.types, strict=True)
        ],
        "contacts": assembly.edges.tolist(),
        "contact_kinds": [
            [i, j, kind]
            for (i, j), kind in zip(observation.contacts[index].tolist(), observation.kinds[index], strict=True)
        ],
        "pieces": [np.flatnonzero(piece == number).tolist() for number in range(int(piece.max()) + 1)],
        "hubs": [{"part": part, "name": names[part], "contacts": degrees[part]} for part in hub_parts(assembly)],
    }


def types_sentence(identified: IdentifiedParts) -> str:
    """Return how many part types there are, and the commonest."""
    parts = np.concatenate([assembly.types for assembly in identified.assemblies])
    counts = np.bincount(parts, minlength=len(identified.types))
    commonest = np.argsort(-counts, kind="stable")[:MAX_TYPES_NAMED]
    named = ", ".join(f"{counts[kind]} {identified.types[kind].name}" for kind in commonest)
    others = f" and {len(counts) - MAX_TYPES_NAMED} more" if len(counts) > MAX_TYPES_NAMED else ""
    return f"{len(counts)} part type{'' if len(counts) == 1 else 's'}: {named}{others}"


def contact_sentences(contacts: ResolvedContacts, models: Sequence[Model]) -> Iterator[str]:
    """Yield how many contacts the parts of each model have, and which axis points up."""
    found = contacts.analysis.contacts
    for model, assembly, kinds in zip(models, found.counted, found.kinds, strict=True):
        sizes = np.bincount(connected_pieces(assembly)).tolist()
        whole = "in one piece" if len(sizes) == 1 else f"in {_pieces(sizes)}"
        counted = f" ({_counted(kinds)})" if kinds else ""
        name = f"{model.path}: " if len(models) > 1 else ""
        yield f"{name}{len(kinds)} contacts{counted}, {whole}"
    why = f": {contacts.reasons['up']}" if "up" in contacts.reasons else ", as stated"
    yield f"{contacts.config.resolved().up} points up{why}"


def _counted(kinds: Sequence[ContactKind]) -> str:
    return ", ".join(f"{kinds.count(kind)} {words}" for kind, words in CONTACT_WORDS.items() if kind in kinds)


def _pieces(sizes: Sequence[int]) -> str:
    listed = ", ".join(map(str, sizes[:MAX_PIECES_SHOWN])) + (" ..." if len(sizes) > MAX_PIECES_SHOWN else "")
    return f"{len(sizes)} pieces of {listed} parts"


def observation_lines(described: dict[str, Any], config: KitConfig) -> Iterator[str]:
    """Yield what `describe_observation` returns as lines for people; `config` has every key resolved."""
    models = described.get("models", [described])
    for model in models:
        yield model["model"]
        for title, line in _model_lines(model, config):
            yield f"  {title:<10} {line}"
        yield ""
    types = described["types"]
    rules = sum(len(around) for around in described["neighbourhoods"].values())
    twins = {name: other for pair in described["mirror_twins"] for name, other in (pair, pair[::-1])}
    used = [[part["type"] for part in model["parts"]] for model in models]
    header = ["type", *(f"in {number + 1}" for number in range(len(models))), "triangles", "symmetries", ""]
    if len(models) == 1:
        header[1] = "parts"
    rows = [
        [
            kind["name"],
            *(str(names.count(kind["name"])) for names in used),
            str(kind["triangles"]),
            str(kind["symmetries"]),
            f"mirror image of {twins[kind['name']]}" if kind["name"] in twins else "",
        ]
        for kind in sorted(types, key=lambda kind: -kind["count"])
    ]
    yield from _table([header, *rows[:MAX_TYPES_SHOWN]])
    if len(rows) > MAX_TYPES_SHOWN:
        yield f"and {len(rows) - MAX_TYPES_SHOWN} more types, of {sum(kind['count'] for kind in types)} parts in all"
    yield ""
    share = config.resolved().tolerance
    yield f"tolerance  {described['tolerance']:.4g} units, {share:g} of the median part's diagonal"
    repaired = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in described["repairs"].items())
    yield f"repairs    {repaired or 'none needed'}"
    yield f"grammar    {rules} neighbourhoods, {len(described['dockings'])} dockings of {len(types)} part types"
    if twins:
        yield "mirrored   a part and its mirror image are one type with `mirror_images_match: true`"
    for number, warning in enumerate(described["warnings"]):
        yield f"{'' if number else 'warnings':<10} - {warning}"


def _model_lines(model: dict[str, Any], config: KitConfig) -> Iterator[tuple[str, str]]:
    """Yield title and line of what is particular to one model."""
    kinds = [kind for _, _, kind in model["contact_kinds"]]
    sizes = [len(piece) for piece in model["pieces"]]
    degrees = np.bincount(np.array(model["contacts"], dtype=int).ravel(), minlength=len(model["parts"]))
    yield "parts", f"{len(model['parts'])} by {model['segmentation']['parts']} ({model['segmentation']['why']})"
    counted = _counted(kinds)
    uncounted = len(kinds) - len(model["contacts"])
    aside = f"; {uncounted} of them do not count, only kinds {', '.join(config.resolved().kinds)}" if uncounted else ""
    yield "contacts", f"{len(kinds)}" + (f": {counted}" if counted else "") + aside
    yield "connected", "yes" if len(sizes) == 1 else f"no, {_pieces(sizes)}"
    if len(degrees) > 1:
        yield "degree", f"a part touches {degrees.min()} to {degrees.max()} others, {degrees.mean():.1f} on average"


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield lines with the first and the last column left-aligned and the others right-aligned."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for first, *middle, last in rows:
        cells = [first.ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(middle, widths[1:], strict=False))]
        yield "  ".join([*cells, last]).rstrip()
