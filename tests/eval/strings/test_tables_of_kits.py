"""Tables about what is made of kits: a search on the real mill, and what they say of it."""

from __future__ import annotations

import json
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import yaml

from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.registry import find_tables
from eval.strings.compression import COLUMNS as SIZES
from eval.strings.compression import Stored, compression_row, round_trip
from eval.strings.corpora import COLUMNS, corpus_row
from eval.strings.growth import Find, Size, grown, growth_table, read_finds, sizes_by
from pipeline.records import read_record
from stages.exemplars.language import dataset_kits
from stages.shape.kit import Assembly
from stages.strings.compression import Codebook
from stages.strings.settings import StringsConfig
from tests.command import shapemill
from tests.stated import stated

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> DatasetRun:
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
    (folder / "small.yaml").write_text(yaml.safe_dump(config))
    for stage in ("autoconfig", "exemplars", "variations", "strings"):
        code, said = shapemill("run", stage, "--config", folder / "small.yaml", "--out", folder, "--workers", 1)
        assert code == 0, said
    return load_dataset_run(folder / "small.yaml", folder)


def find(step: int, generation: int, graph: bytes) -> Find:
    return Find(step, generation, graph, lane=None, index=0)  # type: ignore[arg-type]


def test_a_collection_grows_by_what_is_new_in_each_step() -> None:
    finds = [find(1, 1, b"a"), find(1, 2, b"b"), find(2, 1, b"a"), find(3, 5, b"c"), find(3, 2, b"c")]
    strings = {b"a": 9, b"b": 2, b"c": 4}
    assert sizes_by(finds, lambda each: each.round, strings) == {
        1: Size(shapes=2, graphs=2, strings=11, deepest=2),
        2: Size(shapes=3, graphs=2, strings=11, deepest=2),
        3: Size(shapes=5, graphs=3, strings=15, deepest=5),
    }
    assert sizes_by(finds, lambda each: each.generation, strings)[2] == Size(4, 3, 15, 2)


def test_growth_agrees_with_the_records_of_the_search(subject: DatasetRun) -> None:
    places = subject.paths.stage("variations")
    for name, kit in dataset_kits(subject.paths).items():
        found = grown(kit, places.root, StringsConfig(), 3)
        records = [read_record(path) for path in sorted(places.records.glob(f"{name}-r*-pool.json"))]
        summary = records[-1].summary
        last = found.rounds[len(records)]
        assert (last.shapes, last.graphs) == (summary["found"], summary["graphs"])
        assert [(tries, found.rounds[n + 1].shapes) for n, tries in enumerate(found.tries)] == [
            (tries, shapes) for tries, shapes, _ in summary["curve"]
        ]
        assert last.strings == 9 * last.graphs, "all have more than nine"
        assert list(found.generations.values())[-1].shapes == last.shapes
        assert found.inputs == Size(2, 2, 18, 0)
        rows = {row[0]: row for row in growth_table({name: found}).rows}
        assert rows[f"{name}, inputs"][1] == sum(
            len(kit.types[kind].faces) for each in kit.exemplars for kind in each.assembly.types
        )


def test_a_shape_is_one_generation_above_the_highest_of_its_parents(subject: DatasetRun) -> None:
    folder = subject.paths.stage("variations").root
    parents = {
        f"{path.name.removesuffix('.lineage.jsonl')}-{number}": json.loads(line)["parents"]
        for path in folder.glob("castle-r*.lineage.jsonl")
        for number, line in enumerate(path.read_text().splitlines())
    }

    @cache
    def generation(name: str) -> int:
        return 1 + max(map(generation, parents[name])) if name in parents else 0

    finds = read_finds(folder, "castle")
    assert [each.generation for each in finds] == [generation(f"{each.lane.name}-{each.index}") for each in finds]
    assert len({each.generation for each in finds}) > 1
    assert all(np.isfinite(each.assembly.poses).all() for each in finds)


def test_growth_is_a_table_of_what_has_been_searched(subject: DatasetRun, tmp_path: Path) -> None:
    table = find_tables()["growth"]
    assert table.missing(subject) == ""
    assert "make exemplars" in table.missing(load_dataset_run(subject.config.path, tmp_path))
    answer = table.answer(subject, None)  # type: ignore[arg-type]
    assert [row[0] for row in answer.tables[0].rows[:2]] == ["castle, inputs", "castle, iteration 1"]
    generations = answer.tables[1]
    assert generations.columns[1:] == ("castle graphs", "castle strings", "playground graphs", "playground strings")
    final = [[row[column] for row in generations.rows if row[column] != ""][-1] for column in (1, 3)]
    last = {str(row[0]).partition(",")[0]: row for row in answer.tables[0].rows}
    assert final == [last[kit][5] for kit in ("castle", "playground")], "graphs after the last iteration"
    assert [strip.pictures[0][0] for strip in answer.strips] == ["keep", "fort"]
    assert set(answer.curves[0].lines) == {"castle", "playground"}


def test_a_tree_is_shorter_than_the_whole_graph_by_its_cycle_numbers(subject: DatasetRun) -> None:
    for kit in dataset_kits(subject.paths).values():
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


def test_shapes_in_pieces_are_counted_as_without_strings(subject: DatasetRun) -> None:
    kit = dataset_kits(subject.paths)["castle"]
    whole = kit.exemplars[0].assembly
    apart = Assembly(whole.types, whole.poses, whole.edges[:10])
    row = dict(zip(COLUMNS, corpus_row("two", kit, [whole, apart], "tree", np.random.default_rng(1)), strict=True))
    assert (row["shapes"], row["without"]) == (1, 1)
    assert corpus_row("none", kit, [apart], "all", np.random.default_rng(1))[2:5] == (0, 1, "")


def test_corpora_is_a_table_of_inputs_and_variants(subject: DatasetRun) -> None:
    table = find_tables()["corpora"].answer(subject, None).tables[0]  # type: ignore[arg-type]
    assert [row[:2] for row in table.rows[:4]] == [
        ("castle, inputs", "all"),
        ("castle, inputs", "faces"),
        ("castle, inputs", "tree"),
        ("castle, variants", "all"),
    ]
    assert len(table.rows) == 2 * 2 * 3


def test_every_shape_of_a_search_comes_back_from_its_bytes(subject: DatasetRun) -> None:
    for name, kit in dataset_kits(subject.paths).items():
        finds = [each.assembly for each in read_finds(subject.paths.stage("variations").root, name)]
        for edges in ("all", "tree"):
            book = Codebook(kit, edges)
            trips = [round_trip(book, each) for each in finds]
            assert all(each.exact and each.own_poses == 0 for each in trips)
            stored = [Stored(each, b'{"key": "a"}' * 50, b"glTF" * 1000) for each in finds]
            row = dict(zip(SIZES, compression_row(name, kit, edges, stored, trips), strict=True))
            assert row["exact %"] == 100
            assert row["bytes"] == pytest.approx(np.mean([len(each.packed) for each in trips]))
            assert row["GLB / bytes"] == pytest.approx(4000 / row["bytes"])
            assert row["bytes"] < 200


def test_a_shape_that_does_not_come_back_is_told(subject: DatasetRun) -> None:
    """A part that touches another in a way that the kit has not seen: a tree cannot find that contact again."""
    kit = dataset_kits(subject.paths)["castle"]
    whole = kit.exemplars[0].assembly
    touching = {tuple(each) for each in whole.edges.tolist()}
    apart = next(pair for pair in combinations(range(len(whole)), 2) if pair not in touching)
    more = Assembly(whole.types, whole.poses, np.concatenate([whole.edges, [apart]]).astype(np.int32))
    assert round_trip(Codebook(kit, "all"), more).exact
    trip = round_trip(Codebook(kit, "tree"), more)
    assert (trip.exact, trip.gap <= 1.0) == (False, True)
