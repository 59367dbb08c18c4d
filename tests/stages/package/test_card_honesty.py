"""Each sentence of a card has a condition: it is there exactly where the config and the records say that it holds."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from pipeline.config import Config, load_config
from pipeline.registry import find_stages
from stages.package.card import CardText, card
from stages.package.member_descriptions import describe_members
from stages.package.producer_text import producer_text
from stages.package.sources import SourceTally
from stages.package.stage import dataset_facts
from stages.shape.collection.discovery import language_of, members, producers
from tests.stated import stated

Sections = dict[str, Any]
FORT = stated({"name": "fort", "shapes": ["datasets/exemplars/playground/fort.glb"]})
NO_VARIANTS = {"exemplars": {"kits": [FORT]}, "variations": {"samples_per_kit": 0}}
TOWNHOUSE = {"name": "house", "model": "datasets/exemplars/facade/townhouse.glb", "radius": 0.1}
PROGRAMS = {"name": "furniture", "path": "datasets/exemplars/programs"}
CHAIR = {"programs": {"program": "chair"}}
RANDOM = {"programs": [{"program": name, "mode": "random"} for name in ("chair", "vase")]}
KITS = {"exemplars": {"kits": [FORT]}}
LISTED = {"shapeassembly": {"programs": [{**PROGRAMS, "lists": {"val": "val.txt"}}]}}
BOTH = {"shapeassembly": {"programs": [{**PROGRAMS, "lists": {"val": "val.txt"}}, {**PROGRAMS, "name": "more"}]}}
PRODUCERS: tuple[Sections, ...] = (
    CHAIR,
    RANDOM,
    KITS,
    {"exemplars": {"kits": [{**FORT, "grammar": "slots"}]}},
    {"exemplars": {"kits": [{**FORT, "appearance": "textures"}]}},
    {**KITS, "variations": {"search": {"stretch": {"max_factor": 1.5}}}},
    {**NO_VARIANTS, "proportions": {"samples_per_kit": 9}},
    {
        **NO_VARIANTS,
        "variations": {"samples_per_kit": 0, "rows": {"use": False}},
        "proportions": {"samples_per_kit": 9},
    },
    {"shapeassembly": {"programs": [PROGRAMS]}},
    {"shapeassembly": {"programs": [{**PROGRAMS, "edits": 3}]}},
    {"shapeassembly": {"random": [{"name": "random", "samples": 3}]}},
    LISTED,
    BOTH,
    {"grammars": {"models": [TOWNHOUSE]}},
    {"primitives": {"samples": 9}},
    {"primitives": {"samples": 9, "compositions": ["stack"]}},
    {**NO_VARIANTS, "string_sampling": {"sources": [{"dataset": "a", "model": "b", "kit": "fort", "samples": 3}]}},
    {"mixture": True, **RANDOM, **KITS, "proportions": {"samples_per_kit": 9}, "grammars": {"models": [TOWNHOUSE]}},
)
CAMERAS = {"cameras": [{"kind": "ring", "count": 2}]}
MEMBERS: tuple[Sections, ...] = (
    {},
    {"points": False, "sketches": False},
    {"points": {"surface": "visible"}, "sketches": {"views": []}},
    {"points": {"normalize": "unit_box"}, "views": {**CAMERAS, "images": ["depth"]}, "sketches": False},
    {"points": False, "sketches": False, "views": {**CAMERAS, "images": ["color"]}},
    {"sketches": False, "captions": {"lengths": ["short"]}, "surface": {"flags": True, "union": True}},
    {"surface": {"flags": True}},
    {"points": {"min_per_part": 4, "scans": {"points": 64}}},
    {"points": {"surface": "visible", "min_per_part": 4, "clouds": 2, "scans": {"depth_noise": 0.01}}},
)


@dataclass(frozen=True)
class FinishedPlan:
    """A plan of a config, as far as cards read it: the names of stages' shards, and summaries of some."""

    config: Config
    made_by: tuple[str, ...]
    summaries: Mapping[str, Any] = field(default_factory=dict)

    def shards(self, stage: str) -> list[str]:
        return ["toy-train-000000"] if stage in self.made_by else []

    def summary(self, stage: str, shard: str) -> Mapping[str, Any] | None:
        return self.summaries.get(f"{stage}/{shard}")

    def rejects(self, stage: str, shard: str) -> Mapping[str, int]:
        return {}

    def published(self, file: str) -> Path:
        path = self.config.path.parent / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"weights")
        return path


def enabled(config: Config) -> list[str]:
    """The stages that add members under a config."""
    asked = {
        "validity": True,
        "points": config.sections["points"].enabled,  # type: ignore[attr-defined]
        "sketches": config.sections["sketches"].enabled and config.sections["sketches"].views,  # type: ignore[attr-defined]
        "views": config.sections["views"].cameras,  # type: ignore[attr-defined]
        "strings": config.sections["strings"].enabled,  # type: ignore[attr-defined]
        "captions": config.sections["captions"].lengths,  # type: ignore[attr-defined]
        "surface": config.sections["surface"].is_requested,  # type: ignore[attr-defined]
        "structure": config.sections["structure"].is_requested,  # type: ignore[attr-defined]
    }
    return [stage for stage in members() if asked.get(stage)]


def card_of(folder: Path, sections: Sections, layouts: int = 1) -> tuple[Config, str]:
    """The config and the card of a dataset of one sample a producer."""
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump({"name": "toy", "license": "MIT", **sections}), encoding="utf-8")
    config = load_config(path, {name: stage.config for name, stage in find_stages().items()})
    asked = [name for name, declared in producers().items() if declared.is_requested(config)]
    joining = [name for name in asked if producers()[name].joins]
    makers = [name for name in asked if name not in joining]
    plan = FinishedPlan(config, tuple(asked), {"proportions/toy-choice": {"layouts": {"fort": layouts}}})
    adding = enabled(config)
    names = ["glb", *(item.name for stage in adding for item in members()[stage].of(config)), "json"]
    described = describe_members(config, names, [language_of(maker) for maker in makers])
    said = producer_text(plan, makers, (joining or makers)[0], adding, [])
    text = CardText(kits=["toy"], origins=[], **said)
    shard = {"path": "data/train/toy-1_0_0-train-000000.tar", "split": "train", "samples": 1, "bytes": 1}
    facts = dataset_facts(plan, adding)
    return config, card(facts, [shard], described, {"toy": SourceTally()}, {}, [], text)


def uses(config: Config, *stages: str) -> bool:
    return any(producers()[stage].is_requested(config) for stage in stages)


def section(config: Config, name: str) -> Any:
    return config.sections[name]


def has(config: Config, *stages: str) -> bool:
    return bool(set(stages) & set(enabled(config)))


def resizes(config: Config) -> bool:
    return bool(section(config, "variations").search.stretch.max_factor > 1)


def has_lists(config: Config) -> bool:
    return any(files.lists for files in section(config, "shapeassembly").programs)


def is_random(config: Config) -> bool:
    return uses(config, "programs") and section(config, "programs").sampled[0].mode == "random"


def has_pictures(config: Config) -> bool:
    return has(config, "sketches") or (has(config, "views") and "color" in section(config, "views").images)


def fills(config: Config) -> bool:
    return has(config, "points") and section(config, "points").min_per_part > 0


def scanned(config: Config) -> bool:
    return has(config, "points") and section(config, "points").scans is not None


def rows(config: Config) -> bool:
    return uses(config, "proportions") and section(config, "variations").rows.use is not False


def always(_: Config) -> bool:
    return True


CONDITIONS: tuple[tuple[str, Callable[[Config], bool]], ...] = (
    ("- image-to-3d", has_pictures),
    ("text-to-3d", lambda c: has(c, "captions")),
    ("even where it is hidden inside", lambda c: has(c, "points") and section(c, "points").surface == "all"),
    ("only what is seen from outside", lambda c: has(c, "points") and section(c, "points").surface == "visible"),
    (
        "Points have the coordinates of the mesh",
        lambda c: has(c, "points") and section(c, "points").normalize == "none",
    ),
    ("Points are moved and scaled", lambda c: has(c, "points") and section(c, "points").normalize != "none"),
    ("so that sizes and units are kept", lambda c: has(c, "points") and section(c, "points").normalize == "none"),
    ("Points are not uniform by area", lambda c: has(c, "points") and section(c, "points").min_per_part > 0),
    (
        "each part that is seen well has",
        lambda c: fills(c) and section(c, "points").surface == "visible",
    ),
    ("each part has at least", lambda c: fills(c) and section(c, "points").surface == "all"),
    ("Point cloud 1 of what is seen from outside, drawn independently", lambda c: section(c, "points").clouds > 1),
    ("Scans have the coordinates of the points", scanned),
    ("Points that the cameras of scan 0 see", scanned),
    ("Scans have no noise and no outliers", lambda c: scanned(c) and not section(c, "points").scans.depth_noise),
    ("The noise of scans is normal", lambda c: scanned(c) and section(c, "points").scans.depth_noise > 0),
    ("standard deviation of 0.01 radii", lambda c: scanned(c) and section(c, "points").scans.depth_noise == 0.01),
    ("Scans have no outliers", lambda c: scanned(c) and section(c, "points").scans.depth_noise > 0),
    ("Instances of points and the two rows", lambda c: has(c, "points")),
    ("checks statics and drawings", lambda c: has(c, "sketches") and not has(c, "surface")),
    ("checks statics, drawings and surfaces", lambda c: has(c, "sketches") and has(c, "surface")),
    ("checks statics, captions and surfaces", lambda c: has(c, "captions")),
    ("checks statics.", lambda c: not has(c, "sketches", "captions")),
    ("The union, points with signed distances and the cube", lambda c: section(c, "surface").union),
    ("cameras of the drawings", lambda c: has(c, "sketches")),
    ("cameras of the views", lambda c: has(c, "views")),
    ('sample["points.npy"]', lambda c: has(c, "points")),
    ("from PIL import Image", lambda c: has(c, "views")),
    ("All splits have all values", lambda c: uses(c, "programs") and not is_random(c)),
    ("differ in continuous parameters alone", is_random),
    ("the program has fewer structures than splits", is_random),
    ("No two shapes of a program have equal parameters", lambda c: uses(c, "programs")),
    ("a program builds shapes", lambda c: uses(c, "programs")),
    ("All shapes of a program have its parameters", lambda c: uses(c, "programs")),
    ("those of its program", lambda c: uses(c, "programs")),
    ("poses only translate", lambda c: uses(c, "programs")),
    ("Samples with equal shape graphs are in one split", lambda c: uses(c, "variations")),
    ("every neighbourhood occurs in an exemplar", lambda c: uses(c, "variations") and exact(c)),
    ("every neighbourhood is one that the grammar admits", lambda c: uses(c, "variations") and not exact(c)),
    ("every docking of two parts occurs", lambda c: uses(c, "variations") and not resizes(c)),
    ("touch only as parts touch there", lambda c: uses(c, "variations") and not resizes(c)),
    ("some of them resized", lambda c: uses(c, "variations") and resizes(c)),
    ("may not hold for others", lambda c: uses(c, "variations")),
    ("A variant consists of pieces", lambda c: uses(c, "variations")),
    ("`lineage.parents` are samples of its own split", lambda c: uses(c, "variations")),
    ("The origin of a shape may be anywhere", lambda c: uses(c, "variations", "string_sampling")),
    ("part as its model file has it", lambda c: uses(c, "variations", "string_sampling")),
    ("exemplars are resized", lambda c: uses(c, "proportions")),
    ("One map moves all of space", lambda c: uses(c, "proportions")),
    ("periods of these may be inserted or removed before, and fronts such as doors may be divided", rows),
    ("holds its changes and its factors", rows),
    ("holds its factors", lambda c: uses(c, "proportions") and not rows(c)),
    ("only sizes, the lengths of rows and the number of fronts differ", rows),
    ("only sizes differ", lambda c: uses(c, "proportions") and not rows(c)),
    ("Round parts become oval", lambda c: uses(c, "proportions")),
    ("at equal size some end of a part differs", lambda c: uses(c, "proportions")),
    ("Splits share exemplars", lambda c: uses(c, "proportions")),
    ("lowest point is as high as in the exemplar", lambda c: uses(c, "proportions")),
    ("poses do not rotate", lambda c: uses(c, "proportions")),
    ("ShapeAssembly programs (given)", lambda c: bool(section(c, "shapeassembly").programs) and not edited(c)),
    ("ShapeAssembly programs (drawn at random)", lambda c: bool(section(c, "shapeassembly").random)),
    ("ShapeAssembly programs (given, edited)", lambda c: uses(c, "shapeassembly") and edited(c)),
    ("All parts are cuboids", lambda c: uses(c, "shapeassembly")),
    ("- **grammars**: Parts are terminals", lambda c: uses(c, "grammars") and uses(c, "mixture")),
    ("- Parts are terminals", lambda c: uses(c, "grammars") and not uses(c, "mixture")),
    ("- **programs**: All shapes of a program", lambda c: uses(c, "programs") and uses(c, "mixture")),
    ("- **variations**: All parts are those of", lambda c: uses(c, "variations") and uses(c, "mixture")),
    ("The splits of furniture are published lists", has_lists),
    (
        "Of the others: Programs that differ only",
        lambda c: has_lists(c) and len(section(c, "shapeassembly").programs) > 1,
    ),
    ("differ only in their numbers are in one split", lambda c: uses(c, "shapeassembly") and not all_listed(c)),
    ("The unit is that of the program", lambda c: uses(c, "shapeassembly")),
    ("the middle of each cuboid", lambda c: uses(c, "shapeassembly")),
    ("partial symmetries of a surface", lambda c: uses(c, "grammars")),
    ("No two samples look alike", lambda c: uses(c, "grammars")),
    ("Every neighbourhood of the radius", lambda c: uses(c, "grammars")),
    ("Parts are terminals of the grammar", lambda c: uses(c, "grammars")),
    ("The unit is that of the model file", lambda c: uses(c, "grammars")),
    ("box around the terminal", lambda c: uses(c, "grammars")),
    ("solids of random kinds", lambda c: uses(c, "primitives")),
    ("(heap, stack, attached)", lambda c: uses(c, "primitives") and len(section(c, "primitives").compositions) == 3),
    ("(stack)", lambda c: uses(c, "primitives") and section(c, "primitives").compositions == ("stack",)),
    ("Shapes of the same composition", lambda c: uses(c, "primitives")),
    ("kinds of solids, without a meaning", lambda c: uses(c, "primitives")),
    ("Shapes are on the plane y = 0", lambda c: uses(c, "primitives")),
    ("The origin of a mesh is the middle of its box", lambda c: uses(c, "primitives")),
    ("models trained on the strings", lambda c: uses(c, "string_sampling")),
    ("with the dockings of its kit", lambda c: uses(c, "string_sampling")),
    ("No two samples have the same shape graph", lambda c: uses(c, "string_sampling")),
    ("Similar shapes may be in different splits", lambda c: uses(c, "string_sampling")),
    ("they dock as parts do there", lambda c: uses(c, "string_sampling")),
    ("A model generates shapes like its training", lambda c: uses(c, "string_sampling")),
    ("A sample keeps the split that its producer gave it", lambda c: uses(c, "mixture")),
    ("Samples of two producers share a split", lambda c: uses(c, "mixture")),
    ("All samples were made automatically", always),
    ("Stability is computed by statics", always),
    ("Nothing was simulated or built", always),
    ("at most one colour per face", lambda c: not textured(c)),
    ("materials, textures and normals of their models", lambda c: textured(c)),
    ("Right-handed, y up", always),
    ("The unit is unknown", always),
    ("The ground of a shape", always),
    ("maps its own coordinates", always),
    ("Vertex colours are linear", always),
    ("For training and evaluating models", always),
    ("Not for conclusions about the look", always),
    ("holds the whole config", always),
    ("checks every file", always),
    ("needs numpy and trimesh only", always),
    ("It also checks every record", always),
)
"""What a sentence says, and when it holds."""


def textured(config: Config) -> bool:
    return any(kit.appearance.keep == "textures" for kit in section(config, "exemplars").kits)


def exact(config: Config) -> bool:
    return all(kit.grammar == "multiset" for kit in section(config, "exemplars").kits)


def edited(config: Config) -> bool:
    return any(files.edits for files in section(config, "shapeassembly").programs)


def all_listed(config: Config) -> bool:
    files = section(config, "shapeassembly")
    return all(entry.lists for entry in files.programs) and not files.random


@pytest.mark.parametrize("of_members", range(len(MEMBERS)))
@pytest.mark.parametrize("producer", range(len(PRODUCERS)))
def test_a_sentence_is_there_where_its_condition_holds(tmp_path: Path, producer: int, of_members: int) -> None:
    config, text = card_of(tmp_path, {**PRODUCERS[producer], **MEMBERS[of_members]})
    wrong = [snippet for snippet, holds in CONDITIONS if (snippet in text) != bool(holds(config))]
    assert wrong == []


@pytest.mark.parametrize("producer", range(len(PRODUCERS)))
def test_every_sentence_has_a_condition(tmp_path: Path, producer: int) -> None:
    _, text = card_of(tmp_path, PRODUCERS[producer])
    sections = dict(re.findall(r"(?ms)^## ([^\n]*)\n(.*?)(?=^## |\Z)", text))
    prose = [sections[name] for name in ("Splits", "Coordinates", "Intended use and limitations", "Verification")]
    prose.append(sections["How it was made"].strip().partition("\n#")[0])
    unknown = [
        sentence
        for paragraph in prose
        for sentence in re.split(r"(?<=[a-z`)]\.)\s+", paragraph.strip())
        if sentence and not sentence.startswith("|") and not any(snippet in sentence for snippet, _ in CONDITIONS)
    ]
    assert unknown == []


def test_splits_by_layouts_of_rows_are_said_where_there_are_enough(tmp_path: Path) -> None:
    sections = {**NO_VARIANTS, "proportions": {"samples_per_kit": 9}}
    for layouts, said in ((19, False), (20, True)):
        assert ("which measures unseen lengths of rows" in card_of(tmp_path, sections, layouts)[1]) == said


def test_stated_task_categories_stay_and_a_dataset_without_any_has_none(tmp_path: Path) -> None:
    stated_ones = {**CHAIR, "package": {"task_categories": ["other"]}}
    assert "task_categories:\n- other\n" in card_of(tmp_path, stated_ones)[1]
    assert "task_categories" not in card_of(tmp_path, {**CHAIR, "points": False, "sketches": False})[1]


def test_the_text_of_a_mixture_of_kits_alone_is_described_where_strings_are_turned_off(tmp_path: Path) -> None:
    path = tmp_path / "toy.yaml"
    path.write_text(yaml.safe_dump({"name": "toy", "mixture": True, "strings": False, **KITS}), encoding="utf-8")
    config = load_config(path, {name: stage.config for name, stage in find_stages().items()})
    described = describe_members(config, ["txt", "json"], [language_of("variations")])
    assert described[0]["sentence"] == "A line that says that strings are turned off."
