"""What is resolved for toy kits whose languages are known."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stages.autoconfig import setting_search
from stages.autoconfig.contact_analysis import ContactAnalysis, Setting, resolve_contact_tolerance
from stages.autoconfig.resolve import REQUIREMENT_KEYS, Resolution, resolve_max_copied, resolve_settings, resolve_stable
from stages.autoconfig.setting_search import CandidateSetting
from stages.autoconfig.trial_search import TrialResult, TrialSearch
from stages.autoconfig.up_axis import resolve_up_axis
from stages.autoconfig.yield_estimate import YieldEstimate, estimate_yield
from stages.exemplars.build import build_kit
from stages.exemplars.identify import identify_parts
from stages.exemplars.model import Model
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, HubConfig, KitConfig
from stages.inspection.report import inspect_models
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import ContactKind
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, box, chain, config_of, kit_of, models_of, pose, ring
from tests.toy_kits.tables import ROUND, SQUARE, THICK, THIN, table

ROOT = Path(__file__).resolve().parents[3]
MAX_TRIES = 300
CUBE = {"cube": box(1.0, 1.0, 1.0)}
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def auto_config(shapes: Sequence[Sequence[Placed]], **stated: Any) -> KitConfig:
    """Return a config that leaves all keys but the `stated` ones at `auto`."""
    return KitConfig(name="toy", shapes=tuple(config_of(shapes).shapes), **stated)


def resolved(shapes: Sequence[Sequence[Placed]], meshes: dict[str, Any], **stated: Any) -> Resolution:
    config, models = auto_config(shapes, **stated), models_of(meshes, shapes)
    return resolve_settings(config, models, identify_parts(models, config), MAX_TRIES)


def turned(shape: Sequence[Placed]) -> list[Placed]:
    return [(name, Z_UP @ at) for name, at in shape]


def silent(models: Sequence[Model]) -> list[Model]:
    """Return the models as if their format said nothing about the up axis."""
    return [replace(model, path=model.path.with_suffix(".off")) for model in models]


class TestUpAxis:
    @pytest.mark.parametrize(("turn", "axis"), [(False, "y"), (True, "z")])
    def test_model_stands_on_its_broad_side(self, turn: bool, axis: str) -> None:
        shape = turned(ring(2, 3)) if turn else ring(2, 3)
        models = silent(models_of(ROAD, [shape]))
        assert resolve_up_axis(models, identify_parts(models, config_of([shape])))[0] == axis

    def test_tower_stands_with_its_centre_above_its_foot(self) -> None:
        # wider and deeper from storey to storey: along z it would stand on a side of its top, the larger foot
        storeys = {f"storey{k}": box(1 + 0.3 * k, 1.0, 1 + 0.4 * k) for k in range(6)}
        shape = [(name, pose(0, k, 0)) for k, name in enumerate(storeys)]
        models = silent(models_of(storeys, [shape]))
        axis, reason = resolve_up_axis(models, identify_parts(models, config_of([shape])))
        assert (axis, "not above its foot" in reason) == ("y", True)

    @pytest.mark.parametrize(
        ("sizes", "axis", "words"),
        [
            ((8.0, 0.5, 3.0), "y", "by its specification"),
            ((8.0, 3.0, 0.5), "y", "set `up: z` if the model lies on its side"),
        ],
    )
    def test_plank_in_gltf_is_y_up_unless_it_would_fall_over(
        self, sizes: tuple[float, float, float], axis: str, words: str
    ) -> None:
        shape = [("plank", pose(0, 0, 0)), ("plank", pose(sizes[0], 0, 0))]
        models = models_of({"plank": box(*sizes)}, [shape])
        found, reason = resolve_up_axis(models, identify_parts(models, config_of([shape])))
        assert (found, words in reason) == (axis, True)

    def test_table_that_falls_over_overrules_gltf_and_says_how_to_overrule_it_back(self) -> None:
        legs = [("leg", pose(x, y, 0)) for x in (-2, 2) for y in (-1, 1)]
        shape = [*legs, ("top", pose(0, 0, 2.25))]
        meshes = {"leg": box(0.2, 0.2, 4.0), "top": box(5.0, 3.0, 0.5)}
        models = models_of(meshes, [shape])
        axis, reason = resolve_up_axis(models, identify_parts(models, config_of([shape])))
        assert (axis, "set `up: y` to keep to it" in reason) == ("z", True)

    @pytest.mark.parametrize(("suffix", "axis"), [(".obj", "y"), (".off", "z"), (".stl", "z")])
    def test_sign_on_a_wall_stands_in_a_file_whose_format_is_y_up(self, suffix: str, axis: str) -> None:
        # seen alone it would fall over along y, since its centre is in front of its thin lower edge
        shape = [("plate", pose(0, 0, 0)), ("box", pose(0, 0, 1.5))]
        models = models_of({"plate": box(6.0, 4.0, 0.2), "box": box(5.0, 3.0, 2.8)}, [shape])
        signs = [replace(model, path=model.path.with_suffix(suffix)) for model in models]
        assert resolve_up_axis(signs, identify_parts(signs, config_of([shape])))[0] == axis

    def test_specification_of_gltf_says_nothing_of_files_of_trimesh(self) -> None:
        shape = turned(ring(2, 3))
        models = models_of(ROAD, [shape])
        axes = []
        for writer in ("https://github.com/mikedh/trimesh", "Khronos glTF Blender I/O v4.2.57"):
            written = [replace(model, writer=writer) for model in models]
            axes.append(resolve_up_axis(written, identify_parts(written, config_of([shape]))))
        assert [axis for axis, _ in axes] == ["z", "y"]
        assert "trimesh wrote the file, which does not turn models" in axes[0][1]

    def test_axis_stated_by_the_file_is_believed(self) -> None:
        models = [replace(model, up="z") for model in models_of(ROAD, [ring(2, 3)])]
        assert resolve_up_axis(models, identify_parts(models, config_of([ring(2, 3)]))) == ("z", "the file states it")

    def test_rotations_of_equal_parts_decide_between_equal_feet(self) -> None:
        # a cube of eight bricks stands on the same foot along every axis; four of them are quarter turns about z
        brick = {"brick": box(1.0, 1.0, 1.0), "fin": ROAD["corner"]}
        corners = [(x, y, z) for x in (0, 4) for y in (0, 4) for z in (0, 4)]
        shape = [("brick", pose(*at)) for at in corners]
        shape += [("fin", pose(2, 2, 2) @ Z_UP @ pose(0, 0, 0, turns)) for turns in range(4)]
        models = silent(models_of(brick, [shape]))
        axis, reason = resolve_up_axis(models, identify_parts(models, config_of([shape])))
        assert (axis, "3 of 3 times" in reason) == ("z", True)


class TestTolerance:
    @staticmethod
    def row(*gaps: float) -> list[Model]:
        positions = np.cumsum([0.0, *(1.0 + gap for gap in gaps)])
        return models_of({"cube": box(1.0, 1.0, 1.0)}, [[("cube", pose(x, 0, 0)) for x in positions]])

    def tolerance(self, *gaps: float) -> float:
        models = self.row(*gaps)
        return resolve_contact_tolerance(identify_parts(models, config_of([[]])), 1e-3)[0]

    def test_default_stays_if_it_makes_one_piece(self) -> None:
        assert self.tolerance(0.0, 0.0) == 1e-3

    def test_smallest_multiple_that_makes_one_piece_is_taken(self) -> None:
        assert self.tolerance(0.0, 6e-3, 0.0, 0.0) == 5e-3  # of a diagonal of 1.73

    def test_smallest_multiple_with_the_largest_pieces_is_taken(self) -> None:
        assert self.tolerance(0.0, 6e-3, 3.0) == 5e-3


class TestSettings:
    def test_kit_with_enough_layouts_keeps_the_strictest_settings(self) -> None:
        paths = sorted((ROOT / "datasets" / "exemplars" / "playground").glob("*.glb"))
        config = KitConfig(name="playground", shapes=tuple(paths))
        models = [read_parts(path) for path in paths]
        resolution = resolve_settings(config, models, identify_parts(models, config), 2500)
        requirements = {"require.max_copied_share": 0.9, "require.stable": False, "require.labels": ()}
        values = dict(resolution.values)
        assert {"deck", "tower"} & set(values.pop("require.keep_types"))
        assert (values, resolution.settings_tried, resolution.is_sufficient) == (
            {**STRICTEST, **requirements},
            1,
            True,
        )

    def test_stated_keys_are_not_resolved(self) -> None:
        stated = {"up": "z", "grammar": "count_and_set", "disconnected": "error", "hubs": HubConfig(types="none")}
        resolution = resolved([chain(3), chain(5)], CHAIN, **stated)
        assert (
            set(resolution.values)
            == {"contact.tolerance", "contact.kinds", *REQUIREMENT_KEYS}
            == set(resolution.reasons)
        )

    def test_resolution_is_deterministic(self) -> None:
        shapes = [ring(1, 1), ring(2, 3)]
        assert resolved(shapes, ROAD).as_json() == resolved(shapes, ROAD).as_json()

    def test_resolved_config_builds_the_kit(self) -> None:
        shapes = [ring(1, 1), ring(2, 3)]
        config = auto_config(shapes)
        kit, _ = build_kit(config.resolve(resolved(shapes, ROAD).values), models_of(ROAD, shapes))
        assert sum(len(exemplar.assembly) for exemplar in kit.exemplars) == sum(map(len, shapes))

    def test_separate_pieces_are_dropped_with_a_reason(self) -> None:
        shape = [*chain(5), ("link", pose(2, 30, 0))]
        resolution = resolved([shape], CHAIN)
        assert resolution.values["disconnected"] == "largest"
        assert resolution.reasons["disconnected"] == "1 part is apart from the largest piece"

    def test_pieces_of_one_surface_are_never_left_out_as_hubs(self) -> None:
        meshes = {**ROAD, "floor": box(20.0, 1.0, 20.0)}
        shapes = [[*ring(*size), ("floor", pose(0, -0.6, 0))] for size in ((1, 1), (2, 3))]
        config, models = auto_config(shapes), models_of(meshes, shapes)
        identified = identify_parts(models, config)
        cut = [replace(model, segmentation="symmetry") for model in models]
        parts, pieces = (resolve_settings(config, either, identified, MAX_TRIES) for either in (models, cut))
        assert pieces.values["hubs.types"] == "none"
        assert "leaving one out would leave a hole" in pieces.reasons["hubs.types"]
        assert parts.settings_tried > pieces.settings_tried

    def test_hub_that_holds_the_model_together_is_named(self) -> None:
        posts = {"plate": box(20.0, 1.0, 1.0), **{f"post{k}": box(1.0, 1.0 + k, 1.0) for k in range(4)}}
        shape = [("plate", pose(0, 0, 0)), *((f"post{k}", pose(3 * k, 1 + k / 2, 0)) for k in range(4))]
        resolution = resolved([shape], posts)
        assert resolution.values["hubs.types"] == "none"
        assert resolution.reasons["hubs.types"] == "the model falls apart without plate: 1 of 5 parts stay in one piece"

    def test_types_by_meaning_are_searched_by_meaning(self) -> None:
        models = [table(THIN, SQUARE), table(THICK, ROUND)]
        config = auto_config([[], []], types="meaning")
        identified = identify_parts(models, config)
        kinds: tuple[ContactKind, ...] = ("point", "line", "face")
        analysis = ContactAnalysis(identified, 1e-3, config.pose_tolerance, "y", config.fit_tolerance)
        searched = analysis.kit(Setting(kinds, "multiset"))
        built, _ = build_kit(config.resolve(STRICTEST), models)
        assert searched.grammar.neighbourhoods == built.grammar.neighbourhoods
        pairs = [(docking.a, docking.b, docking.kind, docking.depth) for docking in built.grammar.dockings]
        assert [(docking.a, docking.b, docking.kind, docking.depth) for docking in searched.grammar.dockings] == pairs
        assert len(pairs) > len(analysis.contacts.dockings)
        resolution = resolve_settings(config, models, identified, MAX_TRIES)
        assert set(resolution.values) == {*config.auto_keys(), *REQUIREMENT_KEYS}
        assert resolution.values["grammar"] == "multiset"
        assert resolution.trial is not None
        assert resolution.trial.by_meaning
        assert resolution.trial.graphs == resolution.trial.histograms


class TestMaxCopiedShare:
    @pytest.mark.parametrize(
        ("trial", "expected"),
        [
            (TrialResult(5000, 80, 40, 0.1, 0.1, non_copy_rate=0.6), 0.9),
            (TrialResult(5000, 80, 40, 0.1, 0.1, non_copy_rate=0.1), 1.0),  # the search would reject nearly all hits
            (TrialResult(5000, 40, 30, 0.1, 0.1, non_copy_rate=0.6), 1.0),  # too few to choose from
            (None, 1.0),
        ],
    )
    def test_near_copies_are_rejected_if_enough_is_left(self, trial: TrialResult | None, expected: float) -> None:
        assert resolve_max_copied(trial)[0] == expected

    def test_stated_limit_is_not_resolved(self) -> None:
        config, models = auto_config([ring(1, 1), ring(2, 3)]), models_of(ROAD, [ring(1, 1), ring(2, 3)])
        resolution = resolve_settings(config, models, identify_parts(models, config), MAX_TRIES, require=())
        assert set(resolution.values) == set(config.auto_keys())

    def test_hits_are_near_copies_if_less_than_a_tenth_is_new(self) -> None:
        kit, _ = build_kit(config_of([chain(3), chain(5)]), models_of(CHAIN, [chain(3), chain(5)]))
        search = TrialSearch(ContactOracle(kit), np.random.default_rng(1))
        assert search.run(MAX_TRIES, 4).non_copy_rate == 1.0
        shares = [0.5, 0.9, 0.95, 1.0]
        search.variants[:] = [replace(search.variants[0], lineage={"copied": {"share": share}}) for share in shares]
        assert search.result().non_copy_rate == 0.5


class TestStable:
    @staticmethod
    def row(*heights: float) -> Any:
        """Return cubes in a row at some heights; next to a cube on the ground, a lifted one falls."""
        return kit_of(CUBE, [[("cube", pose(x, height, 0)) for x, height in enumerate(heights)]]).exemplars[0]

    def test_unstable_shapes_are_rejected_if_exemplars_and_enough_hits_are_stable(self) -> None:
        kit = kit_of(CUBE, [[("cube", pose(0, 0, 0)), ("cube", pose(1, 0, 0))]])
        flat, arm = self.row(0, 0, 0).assembly, self.row(0, 0.9, 1.8).assembly
        assert resolve_stable(kit, [flat, flat]) == (
            False,
            "none of the 2 most different hits of a short search falls",
        )
        assert resolve_stable(kit, [flat, arm, arm])[0]
        assert not resolve_stable(kit, [flat, *[arm] * 4])[0]  # hardly any would be left
        assert not resolve_stable(kit, [])[0]

    def test_stability_is_not_required_of_kits_with_unstable_exemplars(self) -> None:
        kit = kit_of(CUBE, [[("cube", pose(k, 0.9 * k, 0)) for k in range(3)]])
        flat = self.row(0, 0, 0).assembly
        assert resolve_stable(kit, [flat, kit.exemplars[0].assembly]) == (False, "not even the exemplars are stable")


class TestYieldEstimate:
    def kit(self, shapes: Sequence[Sequence[Placed]], meshes: dict[str, Any]) -> Any:
        return build_kit(config_of(shapes), models_of(meshes, shapes))[0]

    def test_chains_have_one_layout_a_length(self) -> None:
        kit = self.kit([chain(3), chain(5)], CHAIN)
        estimate = estimate_yield(kit, ContactOracle(kit), 2000)
        # 2.5 to 14 parts, the exemplars' 5 and 7 aside, and no link without a cap: 1 to 12 links
        assert estimate.trial.graphs == estimate.trial.histograms == estimate.layouts
        assert estimate.sentence.startswith(f"about {estimate.layouts} layouts, no dataset")

    def test_countable_layouts_are_a_lower_bound(self) -> None:
        kit = self.kit([chain(13), chain(15)], CHAIN)
        estimate = estimate_yield(kit, ContactOracle(kit), 2000)
        assert estimate.layouts is not None
        assert 20 <= estimate.trial.graphs <= estimate.layouts <= 32
        assert re.match(
            r"[23]0 or more layouts of \d+ to \d+ parts, with only about [23]0 parts lists", estimate.sentence
        )
        assert not estimate.is_poor

    def test_layouts_that_look_broken_are_poor_and_name_what_they_lack(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("stages.autoconfig.yield_estimate.lost_support", lambda *_: ("link", "cap", "ring"))
        kit = self.kit([chain(13), chain(15)], CHAIN)
        estimate = estimate_yield(kit, ContactOracle(kit), 2000)
        assert estimate.is_poor
        assert "look broken: nothing is close above or below link and cap and others" in estimate.sentence

    def test_rejected_copies_do_not_count(self) -> None:
        kit = self.kit([ring(1, 1), ring(2, 3)], ROAD)
        estimates = [estimate_yield(kit, ContactOracle(kit), MAX_TRIES, max_copied_share=limit) for limit in (1.0, 0.6)]
        copied = [[hit.lineage["copied"]["share"] for hit in estimate.variants] for estimate in estimates]
        assert max(copied[0]) > 0.6 >= max(copied[1]) > 0.0

    def test_hits_that_hold_a_whole_exemplar_are_foretold(self, monkeypatch: pytest.MonkeyPatch) -> None:
        kit = self.kit([chain(13), chain(15)], CHAIN)
        monkeypatch.setattr("stages.autoconfig.yield_estimate.MIN_PARTS_LISTS", 0)
        monkeypatch.setattr("stages.autoconfig.yield_estimate.MIN_WHOLE_SHARE", 0.1)
        estimate = estimate_yield(kit, ContactOracle(kit), 2000)
        whole = np.mean([hit.lineage["copied"]["exemplar_share"] > 0.9 for hit in estimate.variants])
        assert whole >= 0.1, "a longer chain holds a shorter one"
        assert estimate.sentence.endswith(
            f"; {whole:.0%} hold nearly a whole exemplar in one piece and look like it with more parts"
        )

    def test_a_third_with_all_part_types_is_likely(self) -> None:
        kit = self.kit([chain(3), chain(5)], CHAIN)
        types = ([0, 0], [0, 1], [1, 1], [0, 0, 1])
        hits: list[Any] = [SimpleNamespace(assembly=SimpleNamespace(types=np.array(listed))) for listed in types]
        estimate = YieldEstimate(TrialResult(9, 4, 4, 0.0, 0.0), None, (2, 3), 0.0, "", hits)
        assert estimate.likely_variants(kit) == [hits[1], hits[3]]
        assert replace(estimate, variants=[hits[1]] * 3).likely_variants(kit) == [hits[1]] * 3

    def test_kit_without_repeats_gets_the_mend(self) -> None:
        meshes = {"a": box(1.0, 1.0, 1.0), "b": box(1.0, 1.0, 2.0), "c": box(1.0, 1.0, 3.0)}
        kit = self.kit([[("a", pose(0, 0, 0)), ("b", pose(1, 0, 0)), ("c", pose(2, 0, 0))]], meshes)
        estimate = estimate_yield(kit, ContactOracle(kit), MAX_TRIES)
        assert (estimate.trial.graphs, estimate.layouts) == (0, 0)
        assert "every part is its own type; bring a second model" in estimate.sentence

    @pytest.mark.parametrize(
        ("parts", "segmentation"), [("auto", "components"), ("auto", "nodes"), ("components",) * 2]
    )
    def test_other_cuts_are_named_if_pieces_of_a_mesh_yield_nothing(self, parts: str, segmentation: str) -> None:
        shape = [("link", pose(0, 0, 0)), ("cap", pose(0.75, 0, 0))]
        models = [replace(model, segmentation=segmentation) for model in models_of(CHAIN, [shape])]
        report = inspect_models(auto_config([shape], parts=parts), models, 50)
        sentence = report.sentence
        assert "nothing: every part is its own type" in sentence
        assert "copied" not in dict(report.lines()), "of no hits"
        assert ("`parts: sections`" in sentence) == (parts == "auto" and segmentation == "components")


def test_kit_config_lists_and_resolves_its_auto_keys() -> None:
    config = KitConfig(name="toy", shapes=(Path(__file__),), grammar="multiset")
    assert config.auto_keys() == ("up", "contact.tolerance", "contact.kinds", "hubs.types", "disconnected")
    assert config.resolve({"up": "z", "grammar": "count_and_pairs"}).grammar == "multiset"
    assert config.resolve({"up": "z"}).auto_keys() == config.auto_keys()[1:]
    assert config.resolve(STRICTEST).resolved().kinds == ("point", "line", "face")


def test_reason_says_what_variants_lose_by_the_next_stricter_grammar(monkeypatch: pytest.MonkeyPatch) -> None:
    def try_setting(_: Any, setting: Setting, *__: Any) -> CandidateSetting:
        graphs, lost = {"count_and_pairs": (86, ()), "count_and_set": (153, ("middle",))}.get(setting.grammar, (0, ()))
        return CandidateSetting(setting, TrialResult(100, graphs, graphs, 0.1, 0.1, 0.5, lost_labels=lost), 1.0)

    monkeypatch.setattr(setting_search, "_try_setting", try_setting)
    resolution = resolved([chain(3)], CHAIN)
    assert resolution.values["grammar"] == "count_and_pairs"
    assert resolution.reasons["grammar"] == (
        "86 graphs and 86 histograms in 100 tries; "
        "the next stricter: 153 graphs and 153 histograms in 100 tries, which seldom keep middle"
    )
