"""The selection covers the pool better than first come does."""

from __future__ import annotations

import numpy as np

from stages.variations.novelty.features import AXES, FeatureExtractor, material_shares
from stages.variations.report.measures import growth, pool_measures
from stages.variations.selection.farthest_first import farthest_first, select_diverse, selection_space
from stages.variations.settings import NoveltyConfig, SelectionConfig, VariantRequirements, VariationsConfig
from tests.stages.variations.search.test_search import search
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


def test_farthest_first_on_a_line() -> None:
    points = np.array([[0.0], [1.0], [9.0], [10.0], [5.0]])
    assert farthest_first(points, np.array([[0.0]]), 5).tolist() == [3, 4, 1, 2, 0]
    assert farthest_first(points, np.array([[0.0], [10.0]]), 2).tolist() == [4, 1]


def test_farthest_first_takes_no_point_twice_where_points_are_equal() -> None:
    points = np.zeros((6, 2))
    assert sorted(farthest_first(points, np.zeros((1, 2)), 6).tolist()) == list(range(6))


def test_selection_is_deterministic_and_more_diverse_than_first_come() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    _, found = search(kit, tries=3000, max_size=3.0)
    counts = np.array([np.bincount(variant.assembly.types, minlength=len(kit.types)) for variant in found])
    features = np.array([variant.features for variant in found])
    taken = select_diverse(kit, counts, features, 12, VariationsConfig(), np.random.default_rng(0))
    again = select_diverse(kit, counts, features, 12, VariationsConfig(), np.random.default_rng(0))
    assert taken.tolist() == again.tolist()
    space = selection_space(counts, features)

    def nearest(chosen: np.ndarray) -> float:
        gaps = np.linalg.norm(space[chosen][:, None] - space[chosen][None], axis=2)
        return float(gaps[~np.eye(len(chosen), dtype=bool)].min())

    def farthest_left(chosen: np.ndarray) -> float:
        return float(np.linalg.norm(space[:, None] - space[chosen][None], axis=2).min(axis=1).max())

    first_come = np.arange(12)
    assert nearest(taken) > nearest(first_come)
    assert farthest_left(taken) < farthest_left(first_come)


def test_samples_beyond_max_farthest_first_are_drawn_without_repetition() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    test = FeatureExtractor(kit)
    shape = kit.exemplars[0].assembly
    pure = test.features(shape, material_shares(np.zeros(len(shape), int), 2), test.marks(shape), 1.0)
    features = np.tile(pure, (20, 1))
    features[:, AXES.index("parts")] += np.arange(20)
    counts = np.tile(np.bincount(shape.types, minlength=2), (20, 1))
    config = VariationsConfig(selection=SelectionConfig(max_farthest_first=4))
    chosen = select_diverse(kit, counts, features, 15, config, np.random.default_rng(1))
    assert len(set(chosen.tolist())) == 15
    assert chosen[0] == 19
    everything = select_diverse(kit, counts, features, 50, VariationsConfig(), np.random.default_rng(1))
    assert sorted(everything.tolist()) == list(range(20))


def test_variants_with_all_types_of_the_exemplars_are_selected_first() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    counts = np.tile(np.array([5, 0]), (12, 1))
    counts[[4, 9]] = [3, 2]
    features = np.ones((12, len(AXES)), dtype=np.float32)
    features[:, AXES.index("parts")] += np.arange(12)
    chosen = select_diverse(kit, counts, features, 3, VariationsConfig(), np.random.default_rng(0))
    assert sorted(chosen[:2].tolist()) == [4, 9]
    indifferent = VariationsConfig(require=VariantRequirements(keep_types=False))
    assert chosen.tolist() != select_diverse(kit, counts, features, 3, indifferent, np.random.default_rng(0)).tolist()


def test_measures_of_a_set_counted_by_hand() -> None:
    counts = np.array([[1, 2], [1, 2], [3, 0]], dtype=np.int32)
    features = np.zeros((3, len(AXES)), dtype=np.float32)
    features[:, AXES.index("parts")] = 3
    features[:, AXES.index("mixture")] = [0.0, 0.05, 0.5]
    features[:, AXES.index("neighbourhood_mixture")] = [0.0, 0.01, 0.0]
    features[:, AXES.index("distance")] = [0.0, 0.5, 0.25]
    features[:, AXES.index("copied_share")] = [0.25, 1.0, 0.5]
    digests = np.zeros((3, 2, 32), dtype=np.uint8)
    digests[2] = 1
    measures = pool_measures(counts, features, digests, NoveltyConfig(axes=("mixture",)))
    assert (measures["graphs"], measures["histograms"], measures["cells"]) == (2, 2, 3)
    assert (measures["mixed"], measures["blended"]) == (0.3333, 0.3333)
    assert (measures["distance"], measures["distances"]) == (0.25, [0.0, 0.0, 0.25, 0.25, 0.5])
    assert measures["parts"] == [3.0] * 5
    # Of three pairs one is equal, and two differ by four of six parts.
    assert (measures["copied_share"], measures["mutual_distance"]) == (0.5, 0.4444)
    nothing = pool_measures(counts[:0], features[:0], digests[:0], NoveltyConfig())
    assert (nothing["graphs"], nothing["mixed"], nothing["parts"]) == (0, 0.0, [])


def test_the_saturation_curve_is_shown_at_its_quarters() -> None:
    curve = [[100 * step, 10 * step, step] for step in range(1, 9)]
    assert growth(curve) == "2 after 200 tries, 4 after 400 tries, 6 after 600 tries, 8 after 800 tries"
    assert growth(curve[:1]) == "1 after 100 tries"
