"""What is chosen for kits whose languages are known by heart."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stages.autoconfig.contact_analysis import ContactAnalysis, Setting, resolve_contact_tolerance
from stages.autoconfig.resolve import REQUIREMENT_KEYS, Resolution, resolve_max_copied, resolve_settings, resolve_stable
from stages.autoconfig.trial_search import TrialResult, TrialSearch
from stages.autoconfig.up_axis import resolve_up_axis
from stages.autoconfig.yield_estimate import estimate_yield
from stages.exemplars.build import build_kit
from stages.exemplars.identify import identify_parts
from stages.exemplars.model import Model
from stages.exemplars.read import read_model
from stages.exemplars.settings import STRICTEST, HubConfig, KitConfig
from stages.inspection.report import inspect_models
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import ContactKind
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, box, chain, config_of, kit_of, models_of, pose, ring
from tests.toy_kits.tables import ROUND, SQUARE, THICK, THIN, table

ROOT = Path(__file__).resolve().parents[3]
TRIES = 300
CUBE = {"cube": box(1.0, 1.0, 1.0)}
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def left_open(shapes: Sequence[Sequence[Placed]], **stated: Any) -> KitConfig:
    """A config that leaves everything open but what is `stated`."""
    return KitConfig(name="toy", shapes=tuple(config_of(shapes).shapes), **stated)


def chosen(shapes: Sequence[Sequence[Placed]], meshes: dict[str, Any], **stated: Any) -> Resolution:
    config, models = left_open(shapes, **stated), models_of(meshes, shapes)
    return resolve_settings(config, models, identify_parts(models, config), TRIES)


def turned(shape: Sequence[Placed]) -> list[Placed]:
    return [(name, Z_UP @ at) for name, at in shape]


class TestUp:
    @pytest.mark.parametrize(("turn", "axis"), [(False, "y"), (True, "z")])
    def test_a_model_stands_on_its_broad_side(self, turn: bool, axis: str) -> None:
        shape = turned(ring(2, 3)) if turn else ring(2, 3)
        models = models_of(ROAD, [shape])
        assert resolve_up_axis(models, identify_parts(models, config_of([shape])))[0] == axis

    def test_a_tower_stands_where_its_middle_is_above_its_foot(self) -> None:
        # wider and deeper from storey to storey: along z it would stand on a side of its top, the larger foot
        storeys = {f"storey{k}": box(1 + 0.3 * k, 1.0, 1 + 0.4 * k) for k in range(6)}
        shape = [(name, pose(0, k, 0)) for k, name in enumerate(storeys)]
        models = models_of(storeys, [shape])
        axis, why = resolve_up_axis(models, identify_parts(models, config_of([shape])))
        assert (axis, "not above its foot" in why) == ("y", True)

    def test_the_word_of_a_file_that_chose_it_is_believed(self) -> None:
        models = [replace(each, up="z") for each in models_of(ROAD, [ring(2, 3)])]
        assert resolve_up_axis(models, identify_parts(models, config_of([ring(2, 3)]))) == ("z", "the file says so")

    def test_where_feet_are_alike_equal_parts_are_turned_about_the_vertical(self) -> None:
        # a cube of eight bricks stands on the same foot along every axis; four of them are quarter turns about z
        brick = {"brick": box(1.0, 1.0, 1.0), "fin": ROAD["corner"]}
        corners = [(x, y, z) for x in (0, 4) for y in (0, 4) for z in (0, 4)]
        shape = [("brick", pose(*at)) for at in corners]
        shape += [("fin", pose(2, 2, 2) @ Z_UP @ pose(0, 0, 0, turns)) for turns in range(4)]
        models = models_of(brick, [shape])
        axis, why = resolve_up_axis(models, identify_parts(models, config_of([shape])))
        assert (axis, "3 of 3 times" in why) == ("z", True)


class TestTolerance:
    @staticmethod
    def row(*gaps: float) -> list[Model]:
        places = np.cumsum([0.0, *(1.0 + gap for gap in gaps)])
        return models_of({"cube": box(1.0, 1.0, 1.0)}, [[("cube", pose(x, 0, 0)) for x in places]])

    def tolerance(self, *gaps: float) -> float:
        models = self.row(*gaps)
        return resolve_contact_tolerance(identify_parts(models, config_of([[]])), 1e-3)[0]

    def test_the_default_stays_where_it_makes_one_piece(self) -> None:
        assert self.tolerance(0.0, 0.0) == 1e-3

    def test_the_least_multiple_that_makes_one_piece_is_taken(self) -> None:
        assert self.tolerance(0.0, 6e-3, 0.0, 0.0) == 5e-3  # of a diagonal of 1.73

    def test_what_no_multiple_joins_gets_the_least_that_joins_as_much(self) -> None:
        assert self.tolerance(0.0, 6e-3, 3.0) == 5e-3


class TestLadder:
    def test_a_kit_that_gives_enough_as_it_is_keeps_the_strictest_rules(self) -> None:
        paths = sorted((ROOT / "datasets" / "exemplars" / "playground").glob("*.glb"))
        config = KitConfig(name="playground", shapes=tuple(paths))
        models = [read_model(path) for path in paths]
        made = resolve_settings(config, models, identify_parts(models, config), 2500)
        unasked = {"require.max_copied_share": 0.9, "require.stable": False, "require.labels": ()}
        assert (dict(made.values), made.settings, made.enough) == ({**STRICTEST, **unasked}, 1, True)

    def test_what_the_config_states_is_obeyed_and_not_chosen(self) -> None:
        stated = {"up": "z", "grammar": "count_and_set", "disconnected": "error", "hubs": HubConfig(types="none")}
        made = chosen([chain(3), chain(5)], CHAIN, **stated)
        assert set(made.values) == {"contact.tolerance", "contact.kinds", *REQUIREMENT_KEYS} == set(made.reasons)

    def test_choices_are_the_same_every_time(self) -> None:
        shapes = [ring(1, 1), ring(2, 3)]
        assert chosen(shapes, ROAD).as_json() == chosen(shapes, ROAD).as_json()

    def test_a_chosen_config_builds_the_kit(self) -> None:
        shapes = [ring(1, 1), ring(2, 3)]
        config = left_open(shapes)
        kit, _ = build_kit(config.resolve(chosen(shapes, ROAD).values), models_of(ROAD, shapes))
        assert sum(len(each.assembly) for each in kit.exemplars) == sum(map(len, shapes))

    def test_what_stands_apart_is_left_out_and_the_reason_says_so(self) -> None:
        shape = [*chain(5), ("link", pose(2, 30, 0))]
        made = chosen([shape], CHAIN)
        assert made.values["disconnected"] == "largest"
        assert made.reasons["disconnected"] == "1 part stands apart from the largest piece"

    def test_pieces_of_one_surface_are_never_left_out_as_hubs(self) -> None:
        meshes = {**ROAD, "floor": box(20.0, 1.0, 20.0)}
        shapes = [[*ring(*size), ("floor", pose(0, -0.6, 0))] for size in ((1, 1), (2, 3))]
        config, models = left_open(shapes), models_of(meshes, shapes)
        identified = identify_parts(models, config)
        cut = [replace(each, segmentation="symmetry") for each in models]
        parts, pieces = (resolve_settings(config, each, identified, TRIES) for each in (models, cut))
        assert pieces.values["hubs.types"] == "none"
        assert "a hole where one is left out" in pieces.reasons["hubs.types"]
        assert parts.settings > pieces.settings

    def test_a_hub_without_which_the_model_falls_apart_is_named(self) -> None:
        posts = {"plate": box(20.0, 1.0, 1.0), **{f"post{k}": box(1.0, 1.0 + k, 1.0) for k in range(4)}}
        shape = [("plate", pose(0, 0, 0)), *((f"post{k}", pose(3 * k, 1 + k / 2, 0)) for k in range(4))]
        made = chosen([shape], posts)
        assert made.values["hubs.types"] == "none"
        assert made.reasons["hubs.types"] == "the model falls apart without plate: 1 of 5 parts stay in one piece"

    def test_what_is_told_by_meaning_is_probed_by_meaning(self) -> None:
        models = [table(THIN, SQUARE), table(THICK, ROUND)]
        config = left_open([[], []], types="meaning")
        identified = identify_parts(models, config)
        kinds: tuple[ContactKind, ...] = ("point", "line", "face")
        sight = ContactAnalysis(identified, 1e-3, config.pose_tolerance, "y", config.fit_tolerance)
        probed = sight.kit(Setting(kinds, "multiset"))
        built, _ = build_kit(config.resolve(STRICTEST), models)
        assert probed.grammar.neighbourhoods == built.grammar.neighbourhoods
        pairs = [(each.a, each.b, each.kind, each.depth) for each in built.grammar.dockings]
        assert [(each.a, each.b, each.kind, each.depth) for each in probed.grammar.dockings] == pairs
        assert len(pairs) > len(sight.contacts.dockings)
        made = resolve_settings(config, models, identified, TRIES)
        assert set(made.values) == {*config.auto_keys(), *REQUIREMENT_KEYS}
        assert made.values["grammar"] == "multiset"
        assert made.finds is not None
        assert made.finds.by_meaning
        assert made.finds.graphs == made.finds.histograms


class TestCopies:
    @pytest.mark.parametrize(
        ("finds", "most"),
        [
            (TrialResult(5000, 80, 40, 0.1, 0.1, telling=0.6), 0.9),
            (TrialResult(5000, 80, 40, 0.1, 0.1, telling=0.1), 1.0),  # the search would refuse nearly all it finds
            (TrialResult(5000, 40, 30, 0.1, 0.1, telling=0.6), 1.0),  # there are too few to choose from
            (None, 1.0),
        ],
    )
    def test_near_copies_are_refused_where_enough_is_left(self, finds: TrialResult | None, most: float) -> None:
        assert resolve_max_copied(finds)[0] == most

    def test_a_limit_that_is_stated_is_not_chosen(self) -> None:
        config, models = left_open([ring(1, 1), ring(2, 3)]), models_of(ROAD, [ring(1, 1), ring(2, 3)])
        made = resolve_settings(config, models, identify_parts(models, config), TRIES, require=())
        assert set(made.values) == set(config.auto_keys())

    def test_finds_tell_something_unless_they_are_copied_but_for_a_tenth(self) -> None:
        kit, _ = build_kit(config_of([chain(3), chain(5)]), models_of(CHAIN, [chain(3), chain(5)]))
        probe = TrialSearch(ContactOracle(kit), np.random.default_rng(1))
        assert probe.go_on(TRIES, 4).telling == 1.0
        shares = [0.5, 0.9, 0.95, 1.0]
        probe.variants[:] = [replace(probe.variants[0], lineage={"copied": {"share": each}}) for each in shares]
        assert probe.finds().telling == 0.5


class TestStanding:
    @staticmethod
    def row(*heights: float) -> Any:
        """Cubes in a row at some heights: one on the ground and one beside it falls as soon as it is lifted."""
        return kit_of(CUBE, [[("cube", pose(place, height, 0)) for place, height in enumerate(heights)]]).exemplars[0]

    def test_what_falls_is_refused_where_exemplars_stand_and_enough_finds_do(self) -> None:
        kit = kit_of(CUBE, [[("cube", pose(0, 0, 0)), ("cube", pose(1, 0, 0))]])
        flat, arm = self.row(0, 0, 0).assembly, self.row(0, 0.9, 1.8).assembly
        assert resolve_stable(kit, [flat, flat]) == (
            False,
            "none of the 2 most different finds of a short search falls",
        )
        assert resolve_stable(kit, [flat, arm, arm])[0]
        assert not resolve_stable(kit, [flat, *[arm] * 4])[0]  # hardly any would be left
        assert not resolve_stable(kit, [])[0]

    def test_kits_that_do_not_stand_themselves_are_not_asked_to(self) -> None:
        kit = kit_of(CUBE, [[("cube", pose(k, 0.9 * k, 0)) for k in range(3)]])
        flat = self.row(0, 0, 0).assembly
        assert resolve_stable(kit, [flat, kit.exemplars[0].assembly]) == (False, "not even the exemplars stand")


class TestForecast:
    def kit(self, shapes: Sequence[Sequence[Placed]], meshes: dict[str, Any]) -> Any:
        return build_kit(config_of(shapes), models_of(meshes, shapes))[0]

    def test_chains_are_as_many_as_there_are_lengths(self) -> None:
        kit = self.kit([chain(3), chain(5)], CHAIN)
        found = estimate_yield(kit, ContactOracle(kit), 2000)
        # 2.5 to 14 parts, the exemplars' 5 and 7 aside, and no link without a cap: 1 to 12 links
        assert found.finds.graphs == found.finds.histograms == found.layouts
        assert found.sentence.startswith(f"about {found.layouts} layouts, no dataset")

    def test_as_many_as_are_in_sight_are_said_to_be_no_more_than_the_fewest(self) -> None:
        kit = self.kit([chain(13), chain(15)], CHAIN)
        found = estimate_yield(kit, ContactOracle(kit), 2000)
        assert found.layouts is not None
        assert 20 <= found.finds.graphs <= found.layouts <= 32
        assert re.match(
            r"[23]0 or more layouts of \d+ to \d+ parts, but only of about [23]0 parts lists", found.sentence
        )
        assert not found.is_poor

    def test_layouts_that_look_broken_are_no_dataset_and_it_is_said_what_they_lack(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("stages.autoconfig.yield_estimate.bared", lambda *_: ("link", "cap", "ring"))
        kit = self.kit([chain(13), chain(15)], CHAIN)
        found = estimate_yield(kit, ContactOracle(kit), 2000)
        assert found.is_poor
        assert "look broken, for nothing stands close above or below link and cap and others" in found.sentence

    def test_what_will_be_refused_for_what_it_copies_does_not_count(self) -> None:
        kit = self.kit([ring(1, 1), ring(2, 3)], ROAD)
        found = [estimate_yield(kit, ContactOracle(kit), TRIES, copied=most) for most in (1.0, 0.6)]
        copied = [[each.lineage["copied"]["share"] for each in one.variants] for one in found]
        assert max(copied[0]) > 0.6 >= max(copied[1]) > 0.0

    def test_every_part_its_own_type_is_said_with_the_mend(self) -> None:
        meshes = {"a": box(1.0, 1.0, 1.0), "b": box(1.0, 1.0, 2.0), "c": box(1.0, 1.0, 3.0)}
        kit = self.kit([[("a", pose(0, 0, 0)), ("b", pose(1, 0, 0)), ("c", pose(2, 0, 0))]], meshes)
        found = estimate_yield(kit, ContactOracle(kit), TRIES)
        assert (found.finds.graphs, found.layouts) == (0, 0)
        assert "every part is its own type; bring a second model" in found.sentence

    @pytest.mark.parametrize(
        ("parts", "segmentation"), [("auto", "components"), ("auto", "nodes"), ("components",) * 2]
    )
    def test_where_nothing_comes_of_the_pieces_of_a_mesh_other_cuts_are_named(
        self, parts: str, segmentation: str
    ) -> None:
        shape = [("link", pose(0, 0, 0)), ("cap", pose(0.75, 0, 0))]
        models = [replace(each, segmentation=segmentation) for each in models_of(CHAIN, [shape])]
        sentence = inspect_models(left_open([shape], parts=parts), models, 50).sentence
        assert "nothing: every part is its own type" in sentence
        assert ("`parts: sections`" in sentence) == (parts == "auto" and segmentation == "components")


def test_an_undecided_kit_says_what_is_open() -> None:
    config = KitConfig(name="toy", shapes=(Path(__file__),), grammar="multiset")
    assert config.auto_keys() == ("up", "contact.tolerance", "contact.kinds", "hubs.types", "disconnected")
    assert config.resolve({"up": "z", "grammar": "count_and_pairs"}).grammar == "multiset"
    assert config.resolve({"up": "z"}).auto_keys() == config.auto_keys()[1:]
    assert config.resolve(STRICTEST).resolved().kinds == ("point", "line", "face")
