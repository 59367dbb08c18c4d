"""The archive leads the search, alike every time; what is refused; whose material a variant is made of."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly
from stages.variations.exchange.pose_matching import lies_in
from stages.variations.kernels.structs import N_EDGES, N_PARTS
from stages.variations.novelty.archive import Archive, cell_of_features
from stages.variations.novelty.features import AXES, FeatureExtractor, material_shares
from stages.variations.search.draft import load_shape
from stages.variations.search.search import RESERVE_FACTOR, Search
from stages.variations.search.variant import SUBASSEMBLY
from stages.variations.settings import NoveltyConfig, SearchConfig
from tests.stages.variations.search.test_search import search
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, pose, ring


def value(features: np.ndarray, axis: str) -> float:
    return float(features[AXES.index(axis)])  # type: ignore[arg-type]


def test_features_of_a_shape_measured_by_hand() -> None:
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


def test_marks_name_the_only_exemplar_of_a_neighbourhood() -> None:
    # In the short chain the only link stands between two caps; nowhere in the long one does any.
    kit = kit_of(CHAIN, [chain(1), chain(4)])
    test = FeatureExtractor(kit)
    names = kit.type_names()
    for number, exemplar in enumerate(kit.exemplars):
        marks = test.marks(exemplar.assembly)
        links = np.array([names[part_type] == "link" for part_type in exemplar.assembly.types])
        assert (marks[links] == number).all()
        assert (marks[~links] == -1).all()


def test_cells_bin_sizes_by_octaves_and_keep_zero_apart() -> None:
    features = np.zeros(len(AXES), dtype=np.float32)
    cells = []
    for parts, mixture in ((16, 0.0), (17, 0.0), (32, 0.0), (16, 0.01)):
        features[AXES.index("parts")], features[AXES.index("mixture")] = parts, mixture
        cells.append(cell_of_features(features, ("parts", "mixture"), 4))
    assert cells == [(16, 0), (16, 0), (20, 0), (16, 1)]


def test_full_cell_takes_only_new_histograms() -> None:
    archive = Archive(cell_quota=2)
    archive.add((1,), 7)
    assert not archive.is_full((1,), 7)
    archive.add((1,), 7)
    assert archive.is_full((1,), 7)
    assert not archive.is_full((1,), 8)
    assert not archive.is_full((2,), 7)
    assert archive.crowds(np.array([archive.add((1,), 7), archive.add((2,), 8)])).tolist() == [9, 1]


def test_reserve_is_kept_but_not_counted_and_no_parent() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    novelty = NoveltyConfig(axes=("height",), cell_quota=1)
    line, found = search(kit, tries=6000, min_size=1.0, max_size=1.6, novelty=novelty)
    known = {line.maker.histogram(exemplar.assembly.types) for exemplar in line.parents.exemplars}
    histograms = {variant.histogram for variant in found} - known
    # All rings are equally high, so there is one cell, and only new perimeters tell anything.
    assert len(histograms) >= 6
    assert len(line.parents.variants) == len(histograms)
    assert line.reserve == len(found) - len(histograms) > 0


def test_search_without_novel_variants_ends() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    config = SearchConfig(max_size=4.0, novelty=NoveltyConfig(axes=("height",), cell_quota=1))
    line = Search(ContactOracle(kit), config)
    found, tries = line.run(np.random.default_rng(0), 100_000, 20, "test", lambda count: None)
    assert tries < 100_000
    assert len(found) == RESERVE_FACTOR * 20 or len(line.parents.variants) == 20


def test_pieces_of_an_exemplar_are_detected() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    line = Search(ContactOracle(kit), SearchConfig())
    whole = line.parents.exemplars[1]
    kept = np.arange(3, 9)
    moved = pose(3.0, 0.0, -2.0, 1) @ whole.assembly.poses[kept]
    piece = Assembly(whole.assembly.types[kept], moved, np.empty((0, 2), np.int32))
    ws = line.maker.ws

    def put(assembly: Assembly) -> None:
        ws.types[: len(assembly)] = assembly.types
        ws.rotations[: len(assembly)], ws.translations[: len(assembly)] = (
            assembly.poses[:, :3, :3],
            assembly.poses[:, :3, 3],
        )
        ws.counts[N_PARTS], ws.counts[N_EDGES] = len(assembly), 0

    put(piece)
    assert lies_in(line.maker.tables, ws, whole.tables)
    assert not lies_in(line.maker.tables, ws, line.parents.exemplars[0].tables)
    moved[2, 0, 3] += 0.2
    put(piece)
    assert not lies_in(line.maker.tables, ws, whole.tables)


def test_no_variant_is_a_piece_of_an_exemplar() -> None:
    # Caps may follow each other at any number of links from one on, so pieces of the exemplars are valid shapes.
    row = [*chain(2), *((name, pose(3, 0, 0) @ at) for name, at in chain(4)), ("cap", pose(7.25, 0, 0))]
    kit = kit_of(CHAIN, [row, [*chain(3), ("cap", pose(3.25, 0, 0))]])
    line, found = search(kit, tries=3000, min_size=0.3)
    assert found
    for variant in found:
        load_shape(line.maker.ws, line.parent("variant", variant.assembly, variant.origins, (0, 0), variant.labels))
        ws, n = line.maker.ws, len(variant.assembly)
        ws.rotations[:n], ws.translations[:n] = variant.assembly.poses[:, :3, :3], variant.assembly.poses[:, :3, 3]
        assert not any(lies_in(line.maker.tables, ws, exemplar.tables) for exemplar in line.parents.exemplars)
    assert line.rejects[SUBASSEMBLY] > 0


def test_sub_assemblies_count_where_asked_for() -> None:
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
    assert all(
        np.isclose(value(variant.features, "copied_share"), variant.lineage["copied"]["share"]) for variant in found
    )


def test_every_part_of_a_variant_has_an_exemplar() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    _, found = search(kit, tries=500)
    for variant in found:
        assert variant.origins.shape == (len(variant.assembly),)
        assert set(variant.origins.tolist()) <= {0, 1}
        shares = material_shares(variant.origins, 2)
        assert np.isclose(value(variant.features, "mixture"), 1 - shares.max())
    assert any(value(variant.features, "mixture") > 0 for variant in found)


def test_archive_is_deterministic_and_finds_more_histograms() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    first = search(kit, seed=2, tries=1500, max_size=4.0)[1]
    again = search(kit, seed=2, tries=1500, max_size=4.0)[1]
    plain = search(kit, seed=2, tries=1500, max_size=4.0, novelty={"guided": False})[1]
    assert [entry.docked for entry in first] == [entry.docked for entry in again]
    assert [entry.origins.tolist() for entry in first] == [entry.origins.tolist() for entry in again]
    assert [entry.docked for entry in first] != [entry.docked for entry in plain]


def test_parents_are_limited_by_the_config() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    line, found = search(kit, tries=2000, max_size=3.0, max_parents=5)
    assert len(found) > 5
    assert len(line.parents.variants) == 5
