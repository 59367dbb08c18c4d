"""Stage `strings` in the pipeline, after two small stages that make a kit and a collection."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import networkx as nx
import numpy as np
import pytest

from pipeline.config import Config, StrictModel
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.run import RunResult, run_stage
from pipeline.shards import ShardWriter, read_shard
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from pipeline.task import make_shard
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Grammar, Kit, PartType
from stages.shape.kit_files import write_kit
from stages.shape.sample import Sample, read_samples, write_sample
from stages.strings.decoder import decode
from stages.strings.members import MEMBERS
from stages.strings.settings import EDGE_DESCRIPTIONS, Edges, StringsConfig
from stages.strings.stage import STAGE
from stages.strings.statistics import measure_string
from stages.strings.tokens import make_alphabet
from tests.stages.shape.collection.absent import ABSENT_SECTIONS, ABSENT_STAGES, named_inputs
from tests.stages.strings.graphs import arrays

KITS = {"castle": ("tower", "gate", "wall"), "chain": tuple(f"link {index}" for index in range(53))}
SPLITS = {"toys-train-000000": "train", "toys-train-000001": "train", "toys-val-000000": "val"}


class KitsConfig(StrictModel):
    """No keys."""


class ShapesConfig(StrictModel):
    """flaw: what is wrong with the collection."""

    flaw: str = ""


def box(name: str) -> PartType:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)
    return PartType(name, vertices, faces, np.zeros((4, 3), dtype=np.uint8), np.eye(4), np.eye(4)[None])


def plan_kits(plan: Plan) -> list[Shard]:
    return [Shard(name) for name in KITS]


def make_kit(task: Task) -> Outcome:
    name = task.shard.name
    kit = Kit(
        name, tuple(box(part_name) for part_name in KITS[name]), (), Grammar({}, (), {}), 0.001, 0.001, ("face",), "z"
    )
    with task.output(f"{name}.json") as text, task.output(f"{name}.tar") as tar:
        write_kit(kit, text, tar)
    return Outcome(1)


def plan_shapes(plan: Plan) -> list[Shard]:
    return [Shard(name, inputs=tuple(f"exemplars/{kit}" for kit in KITS)) for name in SPLITS]


def make_shapes(task: Task) -> Outcome:
    """Two grids and two chains a shard; in the second shard one grid again, as another embedding would be."""
    name, flaw = task.shard.name, task.config.section(ShapesConfig).flaw
    place = list(SPLITS).index(name)
    rng = np.random.default_rng(place)
    shapes = [("castle", nx.grid_2d_graph(3, 4 + place)), ("castle", nx.grid_2d_graph(4, 6 + place))]
    shapes += [("chain", nx.path_graph(3 + place)), ("chain", nx.cycle_graph(5 + place))]
    if flaw == "rings in val" and place == 2:
        shapes[2] = ("chain", nx.cycle_graph(4))
    if place == 1 or (place == 2 and flaw == "one graph in two splits"):
        shapes[0] = ("castle", nx.grid_2d_graph(3, 4))
    with task.output(f"{name}.tar") as stream, ShardWriter(stream) as writer:
        for index, (kit, graph) in enumerate(shapes):
            count = 3 if kit == "castle" else 53
            types, edges = arrays(graph, np.arange(len(graph)) * 7 % count)
            if flaw == "not connected" and index == 1:
                edges = edges[edges[:, 0] > 0]
            digest = "0" * 64 if flaw == "wrong digest" and index == 1 else graph_digest(types, edges)
            poses = np.tile(np.eye(4), (len(types), 1, 1))
            poses[:, 0, 3] = rng.random(len(types))
            key = f"{name}-{index}"
            sample = Sample(key, SPLITS[name], "variations", kit, digest, {}, Assembly(types, poses, edges))
            write_sample(writer, sample)
    return Outcome(len(shapes), {"split": SPLITS[name], "samples": len(shapes)})


def small(plan: Plan) -> int:
    return 100_000


STAGES: Mapping[str, Stage] = named_inputs(
    [
        *ABSENT_STAGES.values(),
        Stage("exemplars", __name__, KitsConfig, (), plan_kits, make_kit, small),
        Stage("variations", __name__, ShapesConfig, ("exemplars",), plan_shapes, make_shapes, small),
        STAGE,
    ]
)


def config(flaw: str = "", count: int = 8, edges: Edges = "all") -> Config:
    sections = {
        **ABSENT_SECTIONS,
        "exemplars": KitsConfig(),
        "variations": ShapesConfig(flaw=flaw),
        "strings": StringsConfig(strings_per_shape=count, edges=edges),
    }
    return Config(name="toys", version="1.0.0", seed=3, sections=sections, path=Path("toys.yaml"))


def make_here(wanted: Config, out: Path, stages: Sequence[str] = tuple(STAGES)) -> dict[str, str]:
    """Make stages in this process; the shards that failed, with what they said."""
    places, failed = DatasetPaths(out, wanted.name), {}
    inventory = Inventory(wanted, STAGES, places)
    for name in stages:
        places.stage(name).make()
        of_stage = inventory.stage(name)
        while fresh := [shard for shard in of_stage.missing if shard.name not in failed]:
            for shard in fresh:
                report = make_shard(inventory.job(name, shard))
                if report.status != "done":
                    failed[shard.name] = report.message
            inventory.refresh(name)
    return failed


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output folder of a run of the stage with one worker."""
    out = tmp_path_factory.mktemp("strings")
    assert make_here(config(), out, ("exemplars", "variations")) == {}
    assert run_stage("strings", STAGES, config(), DatasetPaths(out, "toys"), workers=1) == RunResult(made=4)
    return out


def lines(out: Path, file: str) -> list[str]:
    return (out / "toys-corpus" / file).read_text(encoding="utf-8").splitlines()


def test_samples_have_a_canonical_string_and_distinct_random_strings(made: Path) -> None:
    work = DatasetPaths(made, "toys").work
    for shard in SPLITS:
        samples = {sample.key: sample for sample in read_samples(work / "variations" / f"{shard}.tar")}
        written = dict(read_shard(work / "strings" / f"{shard}.tar"))
        assert list(written) == list(samples)
        for key, members in written.items():
            sample = samples[key]
            assert list(members) == ["txt"]
            strings = members["txt"].decode().splitlines()
            assert len(strings) == len(set(strings))
            is_chain = len(sample.assembly.edges) == len(sample.assembly) - 1
            # a chain is walked from either end, or from a node between them in two orders
            assert len(strings) == (min(9, 2 * len(sample.assembly) - 2) if is_chain else 9)
            alphabet = make_alphabet(KITS[sample.kit])
            for string in strings:
                decoded = decode(string, alphabet)
                assert graph_digest(decoded.types, decoded.edges) == sample.graph


def test_shapes_with_equal_graphs_have_equal_canonical_strings(made: Path) -> None:
    work = DatasetPaths(made, "toys").work / "strings"
    first, again = (
        dict(read_shard(work / f"{shard}.tar"))[f"{shard}-0"]["txt"].decode().splitlines()
        for shard in ("toys-train-000000", "toys-train-000001")
    )
    assert first[0] == again[0]
    assert first[1:] != again[1:]


def test_corpora_have_unique_strings_by_kit_and_split(made: Path) -> None:
    files = {file.name for file in (made / "toys-corpus").iterdir()}
    corpus = {f"{kit}-{split}.txt" for kit in KITS for split in ("train", "val")}
    assert files == corpus | {"vocabulary.json", "statistics.json"}
    work = DatasetPaths(made, "toys").work
    expected: dict[str, list[str]] = {}
    for shard, split in SPLITS.items():
        for sample, (_, members) in zip(
            read_samples(work / "variations" / f"{shard}.tar"),
            read_shard(work / "strings" / f"{shard}.tar"),
            strict=True,
        ):
            expected.setdefault(f"{sample.kit}-{split}.txt", []).extend(members["txt"].decode().splitlines())
    for file in corpus:
        assert lines(made, file) == list(dict.fromkeys(expected[file]))
    assert len(lines(made, "castle-train.txt")) < len(expected["castle-train.txt"])


def test_the_vocabulary_names_the_types_and_lists_every_token(made: Path) -> None:
    vocabulary = json.loads((made / "toys-corpus" / "vocabulary.json").read_text(encoding="utf-8"))
    assert vocabulary["castle"]["types"] == {"A": "tower", "B": "gate", "C": "wall"}
    assert vocabulary["castle"]["tokens"][:7] == ["A", "B", "C", "(", ")", "0", "1"]
    assert vocabulary["chain"]["types"]["[link_52]"] == "link 52"
    assert vocabulary["chain"]["tokens"][53:] == ["(", ")", "0"]


def test_the_statistics_agree_with_the_files(made: Path) -> None:
    statistics = json.loads((made / "toys-corpus" / "statistics.json").read_text(encoding="utf-8"))
    for kit, of_splits in statistics.items():
        for split, described in of_splits.items():
            strings = lines(made, f"{kit}-{split}.txt")
            figures = [measure_string(string) for string in strings]
            assert described["strings"] == len(strings) == sum(described["cycles"]["histogram"].values())
            assert described["characters"]["most"] == max(map(len, strings))
            assert described["tokens"]["mean"] == round(sum(figure.tokens for figure in figures) / len(figures), 3)
            assert described["cycles"]["most"] == max(figure.cycles for figure in figures)
    castle = statistics["castle"]["train"]
    assert (castle["shapes"], castle["graphs"]) == (4, 3)
    assert castle["strings"] + castle["duplicates_dropped"] == 4 * 9
    assert castle["duplicates_dropped"] >= 1
    assert castle["cycles"]["histogram"].keys() == {"6", "15", "18"}  # grids of 3 x 4, 4 x 6 and 4 x 7


def test_the_report_counts_the_corpus(made: Path) -> None:
    inventory = Inventory(config(), STAGES, DatasetPaths(made, "toys"))
    total = sum(len(lines(made, f"{kit}-{split}.txt")) for kit in KITS for split in ("train", "val"))
    report = STAGE.report(inventory.stage("strings").view)
    assert len(report) == 1 + len(KITS)
    assert report[1].startswith("castle: ")
    assert report[1].endswith("cycle rank 10 (median), 21 at most"), "of grids of 3 x 4 to 4 x 8"
    assert report[0].startswith(f"corpus: {total} strings of 11 graphs")


def test_output_does_not_depend_on_the_number_of_workers(made: Path, tmp_path: Path) -> None:
    assert make_here(config(), tmp_path / "here") == {}
    assert make_here(config(), tmp_path / "two", ("exemplars", "variations")) == {}
    run_stage("strings", STAGES, config(), DatasetPaths(tmp_path / "two", "toys"), workers=2)
    for path in sorted((made / ".work" / "toys" / "strings").glob("*.*")):
        for other in ("two", "here"):
            assert (tmp_path / other / ".work" / "toys" / "strings" / path.name).read_bytes() == path.read_bytes()


def test_zero_random_strings_leave_the_canonical_one(tmp_path: Path) -> None:
    assert make_here(config(count=0), tmp_path) == {}
    for shard in SPLITS:
        for _, members in read_shard(tmp_path / ".work" / "toys" / "strings" / f"{shard}.tar"):
            assert members["txt"].count(b"\n") == 1


def test_a_graph_in_two_splits_fails_and_names_both_shapes(tmp_path: Path) -> None:
    failed = make_here(config("one graph in two splits"), tmp_path)
    assert list(failed) == ["corpus"]
    assert "toys-val-000000-0 of val and toys-train-000000-0 of train have the same graph" in failed["corpus"]


def test_a_sample_with_a_wrong_graph_hash_fails_its_shard(tmp_path: Path) -> None:
    failed = make_here(config("wrong digest"), tmp_path)
    assert set(failed) == set(SPLITS)
    assert "sample toys-val-000000-1 is filed under graph 0000" in failed["toys-val-000000"]


def test_shapes_that_are_not_connected_are_rejected_and_counted(tmp_path: Path) -> None:
    assert make_here(config("not connected"), tmp_path) == {}
    inventory = Inventory(config("not connected"), STAGES, DatasetPaths(tmp_path, "toys"))
    records = inventory.stage("strings").records
    for shard in SPLITS:
        assert records[shard].rejects == {"shape graph is not connected": 1}
        assert records[shard].samples == 3


def corpus_file(out: Path, name: str) -> str:
    """A file of the corpus that is not published yet."""
    return (DatasetPaths(out, "toys").work / "strings" / f"corpus.{name}").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def trees(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output folder of the stage for spanning trees."""
    out = tmp_path_factory.mktemp("trees")
    assert make_here(config(edges="tree"), out) == {}
    return out


def test_strings_of_trees_have_no_cycles(trees: Path) -> None:
    work = DatasetPaths(trees, "toys").work
    for shard in SPLITS:
        samples = {sample.key: sample for sample in read_samples(work / "variations" / f"{shard}.tar")}
        for key, members in read_shard(work / "strings" / f"{shard}.tar"):
            for string in members["txt"].decode().splitlines():
                decoded = decode(string, make_alphabet(KITS[samples[key].kit]))
                assert sorted(decoded.types) == sorted(samples[key].assembly.types)
                assert len(decoded.edges) == len(decoded.types) - 1
    vocabulary = json.loads(corpus_file(trees, "vocabulary.json"))
    assert vocabulary["castle"]["tokens"] == ["A", "B", "C", "(", ")"]
    assert (vocabulary["castle"]["edges"], vocabulary["castle"]["meaning"]) == ("tree", EDGE_DESCRIPTIONS["tree"])
    statistics = json.loads(corpus_file(trees, "statistics.json"))
    assert statistics["castle"]["train"]["cycles"]["most"] == 0
    assert statistics["castle"]["train"]["cycle_rank"]["histogram"] == {"6": 2, "15": 1, "18": 1}


def test_a_string_of_several_graphs_occurs_once_in_a_corpus_of_trees(tmp_path: Path) -> None:
    """A ring of links and the chain of the same links have strings in common; here they stand in different splits."""
    assert make_here(config("rings in val", edges="tree", count=40), tmp_path) == {}
    statistics = json.loads(corpus_file(tmp_path, "statistics.json"))
    train, val = (corpus_file(tmp_path, f"chain-{split}.txt").splitlines() for split in ("train", "val"))
    assert not set(train) & set(val)
    assert len(set(train)) == len(train)
    assert statistics["chain"]["val"]["in_other_splits_dropped"] > 0
    assert statistics["chain"]["train"]["in_other_splits_dropped"] == 0
    inventory = Inventory(config("rings in val", edges="tree", count=40), STAGES, DatasetPaths(tmp_path, "toys"))
    assert "of other splits dropped" in STAGE.report(inventory.stage("strings").view)[0]


def test_the_card_describes_edges_and_lengths_of_strings(trees: Path) -> None:
    inventory = Inventory(config(edges="tree"), STAGES, DatasetPaths(trees, "toys"))
    meaning, table = MEMBERS.card(inventory.stage("strings").view)
    assert meaning.startswith(EDGE_DESCRIPTIONS["tree"])
    castle = next(line for line in table.splitlines() if line.startswith("| castle |"))
    assert "| 0, at most 0 | 10, at most 21 |" in castle
    (member,) = MEMBERS.of(config(edges="tree"))
    assert "without the contacts that close cycles" in member.sentence
