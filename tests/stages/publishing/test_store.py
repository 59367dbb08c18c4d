"""Publishing to folders and to an S3 server: what goes up, in which order, and what a stop leaves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import fsspec
import pytest

from stages import api
from tests.command import shapemill
from tests.stages.publishing.conftest import make_dataset

ROOT = Path(__file__).resolve().parents[3]


def contents(url: str) -> Mapping[str, bytes]:
    """The bytes of every file of a dataset and of its index, by path."""
    files, root = fsspec.url_to_fs(url)
    files.invalidate_cache()
    return {
        path.removeprefix(root): files.cat_file(path)
        for folder in (root, f"{root}-index")
        for path in files.find(folder)
    }


def published(*arguments: object) -> str:
    """What `shapemill publish` prints when it succeeds."""
    code, text = shapemill("publish", *arguments)
    assert code == 0, text
    return text


def test_folder_has_the_same_bytes_and_a_second_call_sends_nothing(dataset: Path, tmp_path: Path) -> None:
    target = tmp_path / "shelf/small"
    listed = published(target, dataset, "--dry-run")
    assert "small: 11 files; 0 are at" in listed
    assert "  data/train/small-1_0_0-train-000000.tar  " in listed
    assert not target.parent.exists()
    published(target, dataset)
    assert contents(str(target)) == contents(str(dataset))
    assert "11 are at" in published(target, dataset)
    assert "sent 0 files of 0 bytes" in published(target, dataset)


def test_file_with_other_bytes_is_sent_again(dataset: Path, tmp_path: Path) -> None:
    published(tmp_path / "there", dataset)
    shard = tmp_path / "there/data/val/small-1_0_0-val-000001.tar"
    content = shard.read_bytes()
    shard.write_bytes(content[:-1] + b"x")
    assert "sent 1 files" in published(tmp_path / "there", dataset)
    assert shard.read_bytes() == content


def test_new_version_takes_the_place_of_the_old_one(dataset: Path, tmp_path: Path) -> None:
    newer = make_dataset(tmp_path / "newer/small", version="1.1.0", shards=3)
    published(tmp_path / "there", dataset)
    (tmp_path / "there/NOTES").write_bytes(b"mine")
    published(tmp_path / "there", newer)
    assert contents(str(tmp_path / "there")) == {**contents(str(newer)), "/NOTES": b"mine"}


def test_place_of_another_dataset_is_refused(dataset: Path, tmp_path: Path) -> None:
    other = make_dataset(tmp_path / "other", name="small-2")
    published(tmp_path / "there", other)
    code, text = shapemill("publish", tmp_path / "there", dataset)
    assert code == 2
    assert "small-2-1_0_0-test-000000.tar, which is not of small: publish it elsewhere" in text
    assert contents(str(tmp_path / "there")) == contents(str(other))


def test_dataset_must_have_been_verified_as_it_is(dataset: Path, tmp_path: Path) -> None:
    listing = dataset / "checksums.txt"
    listing.write_text(listing.read_text(encoding="utf-8").replace("README.md", "readme.md"), encoding="utf-8")
    code, text = shapemill("publish", tmp_path / "there", dataset)
    assert (code, "has not been verified without faults as it is now: run `make verify` first" in text) == (2, True)
    assert not (tmp_path / "there").exists()


def test_file_corrupted_since_verification_is_named_and_nothing_opens(dataset: Path, tmp_path: Path) -> None:
    shard = dataset / "data/train/small-1_0_0-train-000001.tar"
    shard.write_bytes(shard.read_bytes()[:-1] + b"x")
    code, text = shapemill("publish", tmp_path / "there", dataset)
    assert code == 2
    assert f"{shard}: is corrupted: it has changed since it was verified" in text
    assert not (tmp_path / "there/manifest.json").exists()


@pytest.mark.parametrize("command", ["status", "doctor"])
def test_command_that_reads_records_is_refused_a_store_with_the_remedy(command: str) -> None:
    code, text = shapemill(command, "--out", "s3://bucket/prefix")
    assert code == 2
    assert "OUT=s3://bucket/prefix: only `make dataset` and its stages write to a store" in text
    assert "name the local folder of their records, datasets unless WORK named another" in text


def test_publishing_to_s3_goes_on_after_a_kill(tmp_path: Path, bucket: str) -> None:
    import s3fs

    dataset, target = make_dataset(tmp_path / "small", shards=36, points=2_000), f"{bucket}/shelf/small"
    server = s3fs.S3FileSystem(use_listings_cache=False)
    process = subprocess.Popen([sys.executable, "-m", "pipeline", "publish", target, dataset], cwd=ROOT)
    while len(server.find("bucket/shelf")) < 5:
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    there = len(server.find("bucket/shelf"))
    assert 5 <= there < 41
    assert not server.exists("bucket/shelf/small/manifest.json")
    assert f"41 files; {there} are at {target} already" in published(target, dataset)
    assert contents(target) == contents(str(dataset))
    assert "sent 0 files" in published(target, dataset)


@pytest.mark.filterwarnings("ignore:This DataLoader will create")
def test_dataset_in_s3_is_read_by_torch_workers(dataset: Path, bucket: str) -> None:
    from torch.utils.data import DataLoader

    published(f"{bucket}/small", dataset)
    local, stored = api.open_dataset(dataset), api.open_dataset(f"{bucket}/small")
    assert list(stored) == list(local)
    train = stored.split("train")
    (batch,) = DataLoader(train, batch_size=4, num_workers=2, collate_fn=list)
    assert batch == list(local.split("train"))


def test_missing_bucket_and_missing_dataset_are_named(dataset: Path, bucket: str) -> None:
    code, text = shapemill("publish", "s3://nobody/small", dataset)
    assert (code, "s3://nobody/small: " in text) == (3, True), text
    code, text = shapemill("publish", bucket, dataset)
    assert (code, "must name a folder of the bucket, such as s3://bucket/small" in text) == (2, True), text
    code, text = shapemill("publish", f"{bucket}/small", dataset / "data")
    assert (code, "is no finished dataset: it has no checksums.txt" in text) == (2, True), text
