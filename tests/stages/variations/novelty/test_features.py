"""The archive leads the search, alike every time; what is refused; whose material a variant is made of."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly
from stages.variations.exchange.pose_matching import lies_in
from stages.variations.kernels.structs import EDGES, PARTS
from stages.variations.novelty.archive import Archive, cell_of
from stages.variations.novelty.features import AXES, FeatureExtractor, material_shares
from stages.variations.search.search import SPARE, SUBASSEMBLY, Search
from stages.variations.settings import NoveltyConfig, SearchConfig
from tests.stages.variations.search.test_search import search
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, pose, ring


def value(features: np.ndarray, axis: str) -> float:
    return float(features[AXES.index(axis)])  # type: ignore[arg-type]


def test_features_of_a_shape_that_can_be_measured_by_hand() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    test = FeatureExtractor(kit)
    shape = kit.exemplars[1].assembly
    features = test.features(shape, np.array([0.25, 0.75]), test.marks(shape), 0.4)
    assert value(features, "parts") == 14
    assert value(features, "cycle_rank") == 1
    assert value(features, "mixture") == 0.25
    assert value(features, "copied_share") == np.float32(0.4)
    assert value(features, "distance") == 0.0
    # Four by five tiles of one unit, from the middle of the corners half a tile out on each side.
    assert np.isclose(value(features, "footprint"), 20, rtol=0.02)
    assert np.isclose(value(features, "aspect"), 5 / 4, rtol=0.02)
    assert np.isclose(value(features, "height"), 0.5, rtol=0.02)


def test_distance_is_the_histogram_metric_to_the_nearest_exemplar() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    test = FeatureExtractor(kit)
    _, found = search(kit, tries=500)
    for variant in found:
        links = len(variant.assembly) - 2
        expected = min(abs(links - 3) / (links + 2 + 5), abs(links - 5) / (links + 2 + 7))
        features = test.features(variant.assembly, np.ones(1), test.marks(variant.assembly), 1.0)
        assert np.isclose(value(features, "distance"), expected)


def test_neighbourhoods_that_one_exemplar_alone_shows_tell_it() -> None:
    # In the short chain the only link stands between two caps; nowhere in the long one does any.
    kit = kit_of(CHAIN, [chain(1), chain(4)])
    test = FeatureExtractor(kit)
    names = kit.type_names()
    for number, exemplar in enumerate(kit.exemplars):
        marks = test.marks(exemplar.assembly)
        links = np.array([names[each] == "link" for each in exemplar.assembly.types])
        assert (marks[links] == number).all()
        assert (marks[~links] == -1).all()


def test_cells_part_sizes_by_octaves_and_keep_a_pure_shape_apart() -> None:
    features = np.zeros(len(AXES), dtype=np.float32)
    cells = []
    for parts, mixture in ((16, 0.0), (17, 0.0), (32, 0.0), (16, 0.01)):
        features[AXES.index("parts")], features[AXES.index("mixture")] = parts, mixture
        cells.append(cell_of(features, ("parts", "mixture"), 4))
    assert cells == [(16, 0), (16, 0), (20, 0), (16, 1)]


def test_a_full_cell_takes_new_histograms_only() -> None:
    archive = Archive(cell_quota=2)
    archive.add((1,), 7)
    assert not archive.is_full((1,), 7)
    archive.add((1,), 7)
    assert archive.is_full((1,), 7)
    assert not archive.is_full((1,), 8)
    assert not archive.is_full((2,), 7)
    assert archive.crowds(np.array([archive.add((1,), 7), archive.add((2,), 8)])).tolist() == [9, 1]


def test_what_adds_nothing_to_the_archive_is_kept_but_neither_counted_nor_built_on() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    novelty = NoveltyConfig(axes=("height",), cell_quota=1)
    line, found = search(kit, tries=6000, min_size=1.0, max_size=1.6, novelty=novelty)
    known = {line.histogram(each.assembly.types) for each in line.parents.exemplars}
    histograms = {variant.histogram for variant in found} - known
    # All rings are equally high, so there is one cell, and only new perimeters tell anything.
    assert len(histograms) >= 6
    assert len(line.parents.variants) == len(histograms)
    assert line.spares == len(found) - len(histograms) > 0


def test_a_search_that_finds_nothing_telling_any_more_ends_all_the_same() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    config = SearchConfig(max_size=4.0, novelty=NoveltyConfig(axes=("height",), cell_quota=1))
    line = Search(ContactOracle(kit), config)
    found, tries = line.run(np.random.default_rng(0), 100_000, 20, "test", lambda count: None)
    assert tries < 100_000
    assert len(found) == SPARE * 20 or len(line.parents.variants) == 20


def test_a_piece_of_an_exemplar_is_told_from_a_new_shape() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    line = Search(ContactOracle(kit), SearchConfig())
    whole = line.parents.exemplars[1]
    kept = np.arange(3, 9)
    moved = pose(3.0, 0.0, -2.0, 1) @ whole.assembly.poses[kept]
    piece = Assembly(whole.assembly.types[kept], moved, np.empty((0, 2), np.int32))
    ws = line._ws

    def put(assembly: Assembly) -> None:
        ws.types[: len(assembly)] = assembly.types
        ws.rotations[: len(assembly)], ws.translations[: len(assembly)] = (
            assembly.poses[:, :3, :3],
            assembly.poses[:, :3, 3],
        )
        ws.counts[PARTS], ws.counts[EDGES] = len(assembly), 0

    put(piece)
    assert lies_in(line.tables, ws, whole.tables)
    assert not lies_in(line.tables, ws, line.parents.exemplars[0].tables)
    moved[2, 0, 3] += 0.2
    put(piece)
    assert not lies_in(line.tables, ws, whole.tables)


def test_no_variant_is_a_piece_of_an_exemplar() -> None:
    # Caps may follow each other at any number of links from one on, so pieces of the exemplars are valid shapes.
    row = [*chain(2), *((name, pose(3, 0, 0) @ at) for name, at in chain(4)), ("cap", pose(7.25, 0, 0))]
    kit = kit_of(CHAIN, [row, [*chain(3), ("cap", pose(3.25, 0, 0))]])
    line, found = search(kit, tries=3000, min_size=0.3)
    assert found
    for variant in found:
        line._load(line.parent("variant", variant.assembly, variant.origins, (0, 0), variant.labels))
        ws, n = line._ws, len(variant.assembly)
        ws.rotations[:n], ws.translations[:n] = variant.assembly.poses[:, :3, :3], variant.assembly.poses[:, :3, 3]
        assert not any(lies_in(line.tables, ws, each.tables) for each in line.parents.exemplars)
    assert line.rejects[SUBASSEMBLY] > 0


def test_a_piece_of_an_exemplar_counts_where_it_is_asked_for() -> None:
    row = [*chain(2), *((name, pose(3, 0, 0) @ at) for name, at in chain(4)), ("cap", pose(7.25, 0, 0))]
    kit = kit_of(CHAIN, [row, [*chain(3), ("cap", pose(3.25, 0, 0))]])
    line, found = search(kit, tries=3000, min_size=0.3, sub_assemblies=True)
    assert SUBASSEMBLY not in line.rejects
    whole = [variant for variant in found if variant.lineage["copied"]["share"] == 1.0]
    assert whole
    for variant in whole:
        assert variant.lineage["copied"]["pieces"] == 1
        assert variant.lineage["copied"]["exemplar_share"] < 1.0
    assert len(whole) < len(found)
    assert all(np.isclose(value(each.features, "copied_share"), each.lineage["copied"]["share"]) for each in found)


def test_every_part_of_a_variant_has_an_exemplar_of_which_it_is() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    _, found = search(kit, tries=500)
    for variant in found:
        assert variant.origins.shape == (len(variant.assembly),)
        assert set(variant.origins.tolist()) <= {0, 1}
        shares = material_shares(variant.origins, 2)
        assert np.isclose(value(variant.features, "mixture"), 1 - shares.max())
    assert any(value(variant.features, "mixture") > 0 for variant in found)


def test_the_archive_chooses_alike_for_the_same_seed_and_leads_to_more_histograms() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    first = search(kit, seed=2, tries=1500, max_size=4.0)[1]
    again = search(kit, seed=2, tries=1500, max_size=4.0)[1]
    plain = search(kit, seed=2, tries=1500, max_size=4.0, novelty={"guided": False})[1]
    assert [each.docked for each in first] == [each.docked for each in again]
    assert [each.origins.tolist() for each in first] == [each.origins.tolist() for each in again]
    assert [each.docked for each in first] != [each.docked for each in plain]


def test_no_more_parents_are_held_than_the_config_allows() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    line, found = search(kit, tries=2000, max_size=3.0, parents=5)
    assert len(found) > 5
    assert len(line.parents.variants) == 5
