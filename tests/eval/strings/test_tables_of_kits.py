"""Tables about kits, after a search on the real pipeline."""

from __future__ import annotations

import json
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import yaml

from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.registry import read_tables
from eval.strings.compression import COLUMNS as SIZES
from eval.strings.compression import StoredSample, compression_row, round_trip
from eval.strings.corpora import COLUMNS, corpus_row
from eval.strings.growth import CollectionSize, KeptVariant, growth_table, measure_growth, read_kept_variants, sizes_by
from pipeline.records import read_record
from stages.exemplars.language import dataset_kits
from stages.shape.kit import Assembly
from stages.strings.compression import Codebook
from stages.strings.settings import StringsConfig
from tests.command import shapemill
from tests.stated import stated

ROOT = Path(__file__).resolve().parents[3]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> DatasetRun:
    """A few castles and playgrounds with their strings, not packaged."""
    folder = tmp_path_factory.mktemp("small")
    kits = [
        stated({"name": name, "shapes": [str(path) for path in sorted((ROOT / "datasets/exemplars" / name).glob("*"))]})
        for name in ("castle", "playground")
    ]
    variations = {
        "samples_per_kit": 6,
        "splits": {"shards": 1},
        "search": {"duplicates": "graph", "tries_per_round": 100, "max_rounds": 3},
    }
    config = {"name": "small", "seed": 3, "exemplars": {"kits": kits}, "variations": variations}
    (folder / "small.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    for stage in ("autoconfig", "exemplars", "variations", "strings"):
        code, said = shapemill("run", stage, "--config", folder / "small.yaml", "--out", folder, "--workers", 1)
        assert code == 0, said
    return load_dataset_run(folder / "small.yaml", folder)


def variant(step: int, generation: int, graph: bytes) -> KeptVariant:
    return KeptVariant(step, generation, graph, found=None, index=0)  # type: ignore[arg-type]


def test_sizes_count_new_graphs_and_strings_per_step() -> None:
    variants = [variant(1, 1, b"a"), variant(1, 2, b"b"), variant(2, 1, b"a"), variant(3, 5, b"c"), variant(3, 2, b"c")]
    strings = {b"a": 9, b"b": 2, b"c": 4}
    assert sizes_by(variants, lambda kept: kept.round, strings) == {
        1: CollectionSize(shapes=2, graphs=2, strings=11, deepest=2),
        2: CollectionSize(shapes=3, graphs=2, strings=11, deepest=2),
        3: CollectionSize(shapes=5, graphs=3, strings=15, deepest=5),
    }
    assert sizes_by(variants, lambda kept: kept.generation, strings)[2] == CollectionSize(4, 3, 15, 2)


def test_growth_agrees_with_search_records(run: DatasetRun) -> None:
    stage = run.paths.stage("variations")
    for name, kit in dataset_kits(run.paths).items():
        growth = measure_growth(kit, stage.root, StringsConfig(), 3)
        records = [read_record(path) for path in sorted(stage.records.glob(f"{name}-r*-pool.json"))]
        summary = records[-1].summary
        last = growth.rounds[len(records)]
        assert (last.shapes, last.graphs) == (summary["found"], summary["graphs"])
        assert [(tries, growth.rounds[number].shapes) for number, tries in enumerate(growth.tries, 1)] == [
            (tries, shapes) for tries, shapes, _ in summary["curve"]
        ]
        assert last.strings == 9 * last.graphs, "all have more than nine"
        assert list(growth.generations.values())[-1].shapes == last.shapes
        assert growth.inputs == CollectionSize(2, 2, 18, 0)
        rows = {row[0]: row for row in growth_table({name: growth}).rows}
        assert rows[f"{name}, inputs"][1] == sum(
            len(kit.types[kind].faces) for exemplar in kit.exemplars for kind in exemplar.assembly.types
        )


def test_generation_is_one_above_the_highest_parent(run: DatasetRun) -> None:
    folder = run.paths.stage("variations").root
    parents = {
        f"{path.name.removesuffix('.lineage.jsonl')}-{number}": json.loads(line)["parents"]
        for path in folder.glob("castle-r*.lineage.jsonl")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines())
    }

    @cache
    def generation(name: str) -> int:
        return 1 + max(map(generation, parents[name])) if name in parents else 0

    variants = read_kept_variants(folder, "castle")
    assert [kept.generation for kept in variants] == [
        generation(f"{kept.found.name}-{kept.index}") for kept in variants
    ]
    assert len({kept.generation for kept in variants}) > 1
    assert all(np.isfinite(kept.assembly.poses).all() for kept in variants)


def test_growth_table_has_rows_and_pictures_of_every_kit(run: DatasetRun, tmp_path: Path) -> None:
    table = read_tables()[0]["growth"]
    assert table.missing(run) == ""
    assert "make exemplars" in table.missing(load_dataset_run(run.config.path, tmp_path))
    result = table.compute(run, table.options())
    assert [row[0] for row in result.tables[0].rows[:2]] == ["castle, inputs", "castle, iteration 1"]
    generations = result.tables[1]
    assert generations.columns[1:] == ("castle graphs", "castle strings", "playground graphs", "playground strings")
    final = [[row[column] for row in generations.rows if row[column] != ""][-1] for column in (1, 3)]
    last = {str(row[0]).partition(",")[0]: row for row in result.tables[0].rows}
    assert final == [last[kit][5] for kit in ("castle", "playground")], "graphs after the last iteration"
    assert [row.pictures[0][0] for row in result.image_rows] == ["keep", "fort"]
    assert set(result.charts[0].lines) == {"castle", "playground"}


def test_tree_string_is_shorter_by_two_tokens_per_cycle(run: DatasetRun) -> None:
    for kit in dataset_kits(run.paths).values():
        for exemplar in kit.exemplars:
            shapes = [exemplar.assembly]
            rows = {
                edges: dict(zip(COLUMNS, corpus_row("one", kit, shapes, edges, np.random.default_rng(1)), strict=True))
                for edges in ("all", "tree")
            }
            rank = len(shapes[0].edges) - len(shapes[0]) + 1
            assert rows["all"]["cycles"] == rows["all"]["cycle rank"] == rows["tree"]["cycle rank"] == rank
            assert rows["tree"]["most cycles"] == 0
            # the canonical walk is the same, and each cycle has two numbers of one token
            assert rows["all"]["canonical"] - rows["tree"]["canonical"] == 2 * rank
            assert rows["all"]["parts"] == len(shapes[0])


def test_disconnected_shapes_count_as_without_strings(run: DatasetRun) -> None:
    kit = dataset_kits(run.paths)["castle"]
    whole = kit.exemplars[0].assembly
    apart = Assembly(whole.types, whole.poses, whole.edges[:10])
    row = dict(zip(COLUMNS, corpus_row("two", kit, [whole, apart], "tree", np.random.default_rng(1)), strict=True))
    assert (row["shapes"], row["without"]) == (1, 1)
    assert corpus_row("none", kit, [apart], "all", np.random.default_rng(1))[2:5] == (0, 1, "")


def test_corpora_table_has_inputs_and_variants(run: DatasetRun) -> None:
    table = read_tables()[0]["corpora"].compute(run, None).tables[0]
    assert [row[:2] for row in table.rows[:4]] == [
        ("castle, inputs", "all"),
        ("castle, inputs", "faces"),
        ("castle, inputs", "tree"),
        ("castle, variants", "all"),
    ]
    assert len(table.rows) == 2 * 2 * 3


def test_every_variant_is_restored_exactly(run: DatasetRun) -> None:
    for name, kit in dataset_kits(run.paths).items():
        assemblies = [kept.assembly for kept in read_kept_variants(run.paths.stage("variations").root, name)]
        for edges in ("all", "tree"):
            book = Codebook(kit, edges)
            trips = [round_trip(book, assembly) for assembly in assemblies]
            assert all(trip.exact and trip.own_poses == 0 for trip in trips)
            stored = [StoredSample(assembly, b'{"key": "a"}' * 50, b"glTF" * 1000) for assembly in assemblies]
            row = dict(zip(SIZES, compression_row(name, kit, edges, stored, trips), strict=True))
            assert row["exact %"] == 100
            assert row["bytes"] == pytest.approx(np.mean([len(trip.packed) for trip in trips]))
            assert row["GLB / bytes"] == pytest.approx(4000 / row["bytes"])
            assert row["bytes"] < 200


def test_lost_contact_is_reported(run: DatasetRun) -> None:
    """A spanning tree cannot restore a contact that the kit has no docking for."""
    kit = dataset_kits(run.paths)["castle"]
    whole = kit.exemplars[0].assembly
    touching = {tuple(edge) for edge in whole.edges.tolist()}
    apart = next(pair for pair in combinations(range(len(whole)), 2) if pair not in touching)
    more = Assembly(whole.types, whole.poses, np.concatenate([whole.edges, [apart]]).astype(np.int32))
    assert round_trip(Codebook(kit, "all"), more).exact
    trip = round_trip(Codebook(kit, "tree"), more)
    assert (trip.exact, trip.gap <= 1.0) == (False, True)
