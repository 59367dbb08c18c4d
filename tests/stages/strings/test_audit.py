"""What `make verify` finds in the strings of a sample, whichever contacts they are to tell of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.paths import DatasetPaths
from stages.shape.collection.packaged import PackagedSample
from stages.shape.collection.pairs import CONTACTS, pair_bytes
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import write_kit
from stages.shape.shape import kit_shape
from stages.strings.audit import AUDIT, string_faults
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import Edges
from tests.stages.strings.test_kit_strings import kit_of


def kit() -> Kit:
    return kit_of("cubes")


def assembly() -> Assembly:
    return kit().exemplars[0].assembly


def written(edges: Edges) -> list[str]:
    writer = KitStrings(kit(), edges)
    return [encoded.string for encoded in writer.strings(writer.graph(assembly()), 3, np.random.default_rng(2))]


def sample(strings: list[str], said: Edges | None) -> PackagedSample:
    """A sample with these strings, of a dataset that says what they tell of, or is older than that."""
    labelled = kit().labelled(assembly())
    record = {"language": "kit", "kit": "cubes", "graph": graph_digest(labelled.types, labelled.edges)}
    members = {"txt": "".join(f"{string}\n" for string in strings).encode(), CONTACTS: pair_bytes(assembly().edges)}
    sections = {"strings": {"strings_per_shape": 3, **({"edges": said} if said else {})}}
    return PackagedSample("cubes-0", record, members, {}, kit_shape(kit(), assembly()), sections)


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> DatasetPaths:
    """Return the folders of the pipeline, with the kit in them."""
    found = DatasetPaths(tmp_path_factory.mktemp("made"), "blocks")
    folder = found.stage("exemplars").root
    folder.mkdir(parents=True)
    with open(folder / "cubes.json", "wb") as text, open(folder / "cubes.tar", "wb") as tar:
        write_kit(kit(), text, tar)
    return found


@pytest.mark.parametrize(("edges", "said"), [("all", None), ("all", "all"), ("faces", "faces"), ("tree", "tree")])
def test_strings_of_the_configured_edges_pass_the_audit(edges: Edges, said: Edges | None, places: DatasetPaths) -> None:
    found = sample(written(edges), said)
    assert list(string_faults(found)) == []
    assert list(AUDIT.recheck(found, places)) == []


def test_another_text_is_no_fault_where_strings_are_turned_off(places: DatasetPaths) -> None:
    """In a mixture every sample has a text, and that of a shape graph says that it has no strings."""
    found = sample(["no text: strings are turned off"], None)
    assert "is no string" in next(string_faults(found))
    off = replace(found, sections={"strings": {"enabled": False}})
    assert [*string_faults(off), *AUDIT.recheck(off, places)] == []


@pytest.mark.parametrize(("edges", "said"), [("all", "tree"), ("tree", "all"), ("faces", "all"), ("faces", "tree")])
def test_strings_of_other_edges_fail_the_audit(edges: Edges, said: Edges) -> None:
    assert list(string_faults(sample(written(edges), said))) == ["line 1 of its txt encodes another graph"]


def test_strings_of_all_contacts_fail_as_strings_of_faces(places: DatasetPaths) -> None:
    found = sample(written("all"), "faces")
    assert list(AUDIT.recheck(found, places)) == ["its txt does not contain its face contacts"]
    faces = written("faces")
    mixed = sample([faces[0], written("all")[1]], "faces")
    assert list(string_faults(mixed)) == ["the lines of its txt encode different graphs"]


def test_a_tree_outside_the_graph_fails_the_audit() -> None:
    first, *others = written("tree")
    letters = [place for place, character in enumerate(first) if character.isalpha()]
    for place in letters[1:]:
        other = next(letter for letter in letters if first[letter] != first[place])
        swapped = list(first)
        swapped[place], swapped[other] = first[other], first[place]
        faults = list(string_faults(sample(["".join(swapped), *others], "tree")))
        assert faults[0] in {
            "line 1 of its txt encodes another graph",
            "the first line of its txt is not the canonical spanning tree",
        }
    assert list(string_faults(sample([others[0], first], "tree"))) == [
        "the first line of its txt is not the canonical spanning tree"
    ]
