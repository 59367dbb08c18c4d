"""`verify` finds what is wrong with a dataset's files, and names it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.package.layout import VERIFIER
from stages.verification.verified import require_verification
from stages.verification.verify import verify_dataset
from tests.command import shapemill
from tests.stages.verification.forge import FOLDER_FORGERIES, FORGERIES, WHOLE_GEOMETRY, copy_dataset, forge

SHARD = "data/val/toy-1_2_0-val-000002.tar"


@pytest.fixture
def folder(toy_folder: Path, tmp_path: Path) -> Path:
    """A copy of the toy dataset, its index and its kits, to be damaged."""
    return copy_dataset(toy_folder, tmp_path, with_work=False)


def verified(*arguments: object) -> int:
    """The exit code of `shapemill verify`, whose output is printed."""
    code, printed = shapemill("verify", *arguments)
    print(printed)
    return code


def flip(path: Path, place: int) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(bytes(content))


def rewrite(folder: Path, file: str, change: Callable[[str], str]) -> None:
    """Change a text file and its checksum, as who makes a dataset wrongly would."""
    from pipeline.paths import file_digest

    before = file_digest(folder / file)
    (folder / file).write_text(change((folder / file).read_text(encoding="utf-8")), encoding="utf-8")
    listing = folder / "checksums.txt"
    listing.write_text(
        listing.read_text(encoding="utf-8").replace(before, file_digest(folder / file)), encoding="utf-8"
    )


def test_a_finished_dataset_is_good(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verified(folder, "--samples", "0") == 0
    printed = capsys.readouterr().out
    assert "23 checked   good" in printed
    assert "faults" not in printed
    require_verification(folder)


@pytest.mark.parametrize("place", [0, 700, -1])
@pytest.mark.parametrize("file", [SHARD, "README.md", "manifest.json", "../toy-index/toy.parquet"])
def test_a_corrupted_byte_is_found_and_its_file_named(
    folder: Path, capsys: pytest.CaptureFixture[str], file: str, place: int
) -> None:
    flip(folder / file, place)
    assert verified(folder, "--samples", "0") == 1
    assert f"checksums: {file}: is corrupted" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="has not been verified without faults as it is now: run `make verify` first"):
        require_verification(folder)


def test_a_missing_shard_is_found_and_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / SHARD).unlink()
    assert verified(folder, "--samples", "0") == 1
    assert f"missing files: {SHARD}: is missing" in capsys.readouterr().out


@pytest.mark.parametrize("file", ["data/val/extra.tar", "notes.txt", "../toy-index/old.parquet"])
def test_a_foreign_file_is_found_and_named(folder: Path, capsys: pytest.CaptureFixture[str], file: str) -> None:
    (folder / file).write_bytes(b"mine")
    assert verified(folder, "--samples", "0") == 1
    assert f"foreign files: {file}: does not belong" in capsys.readouterr().out


def test_a_missing_index_is_found_and_named(folder: Path) -> None:
    shutil.rmtree(folder.parent / "toy-index")
    assert verify_dataset(folder, 0, 0).faults == {"missing files": ["../toy-index/toy.parquet: is missing"]}


def test_a_truncated_checksums_file_makes_the_files_it_leaves_out_foreign(folder: Path) -> None:
    listing = folder / "checksums.txt"
    listing.write_text(
        "".join(line for line in listing.read_text(encoding="utf-8").splitlines(True) if SHARD not in line),
        encoding="utf-8",
    )
    faults = verify_dataset(folder, 0, 0).faults
    assert faults["foreign files"] == [f"{SHARD}: does not belong to the dataset"]
    assert any(SHARD in fault for fault in faults["manifest"])


def test_counts_that_disagree_are_found(folder: Path) -> None:
    rewrite(folder, "manifest.json", lambda text: text.replace('"samples": 2,', '"samples": 3,', 1))
    faults = verify_dataset(folder, 0, 0).faults
    assert any("has 2 samples, the manifest counts 3" in fault for fault in faults["samples"])
    assert any("do not add up to 7 samples" in fault for fault in faults["manifest"])


def test_croissant_and_manifest_must_name_the_same_shards(folder: Path) -> None:
    rewrite(folder, "croissant.json", lambda text: text.replace("val-000002", "val-000009"))
    assert any("manifest.json and croissant.json" in fault for fault in verify_dataset(folder, 0, 0).faults["manifest"])


def test_samples_that_break_the_rules_are_found(folder: Path) -> None:
    """A shard with whole bytes and wrong contents: a null in a JSON, a label that is not its part's type."""
    from pipeline.paths import file_digest
    from pipeline.shards import ShardWriter, array_bytes, bytes_array, read_shard

    samples = list(read_shard(folder / SHARD))
    before = file_digest(folder / SHARD)
    with open(folder / SHARD, "wb") as stream, ShardWriter(stream) as writer:
        (first, one), (second, two) = samples
        writer.write(first, {**one, "json": one["json"].replace(b'"kit":"blocks"', b'"kit":null')})
        writer.write(second, {**two, "labels.npy": array_bytes(1 - bytes_array(two["labels.npy"]))})
    for listing in ("checksums.txt", "manifest.json", "croissant.json"):
        rewrite(folder, listing, lambda text: text.replace(before, file_digest(folder / SHARD)))
    faults = "\n".join(verify_dataset(folder, 0, 0).faults["samples"])
    assert f"{SHARD}: {first}: its json has nothing at kit" in faults
    assert f"{SHARD}: {second}: its point labels are not the classes of their parts" in faults


def test_a_folder_without_a_dataset_is_refused_with_the_mend(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert verified(tmp_path) == 1
    assert "make dataset" in capsys.readouterr().out


def test_geometry_of_random_samples_is_computed_again_from_their_meshes(
    toy_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert verified(toy_folder, "--samples", "10") == 0
    assert "geometry              10 checked   good" in capsys.readouterr().out


def test_a_contact_that_the_meshes_do_not_have_is_found(toy_folder: Path, tmp_path: Path) -> None:
    """A record that says that the two ends of a row touch, in a dataset whose checksums all agree."""
    import json

    from pipeline.shards import read_shard
    from stages.shape.assembly_faults import geometry_faults
    from stages.shape.collection.pairs import CONTACTS, pair_bytes, pairs_of
    from tests.stages.package.toy import toy_kit

    samples = [members for path in toy_folder.rglob("*.tar") for _, members in read_shard(path)]
    members = next(sample for sample in samples if json.loads(sample["json"])["counts"]["parts"] == 3)
    record = json.loads(members["json"])
    kit = toy_kit(record["kit"])
    assert geometry_faults(kit, members) == []
    more = np.concatenate([pairs_of(members[CONTACTS]), [[0, 2]]]).astype(np.int32)
    faults = geometry_faults(kit, {**members, CONTACTS: pair_bytes(more)})
    ends = (record["parts"][0]["name"], record["parts"][2]["name"])
    assert f"{ends[0]} and {ends[1]} are recorded as neighbours and do not touch" in faults


def test_the_dataset_can_be_named_by_its_config(
    toy_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "toy.yaml"
    config.write_text("name: toy\nprograms: {program: chair}\n", encoding="utf-8")
    verified("--config", config, "--out", toy_folder.parent, "--samples", "0")
    printed = capsys.readouterr().out
    assert "checked   good" in printed
    assert "faults" not in printed


BY_STATICS_OR_DRAWING = {"a mirrored sketch", "the sketch of another sample", "a blank sketch", "a truncated sketch"}
"""The toy dataset has sketches of its own, which show nothing."""


@pytest.mark.parametrize("name", sorted({*FORGERIES} - BY_STATICS_OR_DRAWING))
def test_a_forged_sample_is_found_and_named(folder: Path, name: str) -> None:
    """A forged sample is found even with matching checksums, offsets and counts."""
    key = forge(folder, name, np.random.default_rng(len(name)))
    found = verify_dataset(folder, None if name in WHOLE_GEOMETRY else 0, 0).faults
    assert any(key in fault for kind, faults in found.items() for fault in faults if kind != VERIFIER), found


@pytest.mark.parametrize("name", sorted(FOLDER_FORGERIES))
def test_a_forged_folder_is_found(folder: Path, name: str) -> None:
    forge(folder, name, np.random.default_rng(0))
    assert verify_dataset(folder, 0, 0).faults


def test_shards_of_stages_reveal_forgeries_that_samples_hide(toy_folder: Path, tmp_path: Path) -> None:
    folder = copy_dataset(toy_folder, tmp_path, with_work=True)
    assert not verify_dataset(folder, 0, 0).faults
    key = forge(folder, "the sketch of another sample", np.random.default_rng(1))
    faults = verify_dataset(folder, 0, 0).faults["samples"]
    assert any(fault.endswith(f"{key}: sketch0.png is not the one that stage sketches made for it") for fault in faults)


def test_dataset_without_kits_names_what_was_not_checked(
    toy_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("toy", "toy-index"):
        shutil.copytree(toy_folder.parent / name, tmp_path / name)
    assert verified(tmp_path / "toy") == 0
    assert "not checked: 12 samples: kit blocks is missing next to the dataset" in capsys.readouterr().out


@pytest.mark.parametrize(("moved", "same"), [(1e-7, True), (1e-4, False)])
def test_last_digits_of_a_mesh_are_no_fault_and_more_is(toy_folder: Path, moved: float, same: bool) -> None:
    from pipeline.shards import read_shard
    from stages.verification.samples import _same_mesh
    from tests.stages.verification.forge import glb_of, glb_parts

    made = next(read_shard(toy_folder / SHARD))[1]["glb"]
    header, binary = glb_parts(made)
    positions = np.frombuffer(bytes(binary[:96]), "<f4") + np.float32(moved)
    binary[:96] = positions.tobytes()
    assert _same_mesh(glb_of(header, bytes(binary)), glb_of(*glb_parts(made)), 5.0) == same
    header["nodes"][0]["extras"]["class"] += 1
    assert not _same_mesh(glb_of(header, bytes(binary)), glb_of(*glb_parts(made)), 5.0)
