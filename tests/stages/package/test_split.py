"""Random access to the samples of a split, as torch uses it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import fsspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.errors import ConfigError
from stages import api
from tests.stages.package.toy import SPLITS, toy_keys

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def copied(toy_folder: Path, tmp_path: Path) -> Path:
    """A copy of the toy dataset and its index in folders with other names, to be damaged."""
    shutil.copytree(toy_folder.with_name("toy-index"), tmp_path / "mine-index")
    return Path(shutil.copytree(toy_folder, tmp_path / "mine"))


def change_index(folder: Path, column: str, value: object) -> None:
    """Set a column of the first row of the index."""
    path = folder.with_name("mine-index") / "toy.parquet"
    table = pq.read_table(path)
    rows = table.to_pylist()
    rows[0][column] = value
    pq.write_table(pa.Table.from_pylist(rows, table.schema), path)


@pytest.mark.parametrize("split", SPLITS)
def test_samples_by_place_are_those_that_streaming_yields(toy_folder: Path, split: str) -> None:
    dataset = api.open_dataset(toy_folder)
    streamed, indexed = list(dataset.samples(split)), dataset.split(split)
    assert [sample.key for sample in streamed] == toy_keys(split)
    assert [indexed[place] for place in range(len(indexed))] == streamed
    assert (indexed[-1], indexed[1:3]) == (streamed[-1], streamed[1:3])
    with pytest.raises(IndexError):
        indexed[len(indexed)]


def test_dataset_in_a_store_reads_as_in_a_folder(toy_folder: Path) -> None:
    fsspec.filesystem("memory").put(f"{toy_folder}", "/bucket/toy", recursive=True)
    fsspec.filesystem("memory").put(f"{toy_folder}-index", "/bucket/toy-index", recursive=True)
    local, stored = api.open_dataset(toy_folder), api.open_dataset("memory://bucket/toy")
    assert list(stored) == list(local)
    assert list(stored.split("train")) == list(local.split("train"))


@pytest.mark.filterwarnings("ignore:This DataLoader will create")
def test_example_of_the_page_resumes_in_the_middle_of_an_epoch(
    toy_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "datasets").mkdir()
    for ending in ("", "-index"):
        (tmp_path / f"datasets/shapemill-default{ending}").symlink_to(f"{toy_folder}{ending}")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "stages/package/README.md").read_text(encoding="utf-8")
    (code,) = [block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "DistributedSampler" in block]
    code = code.replace("batch_size=16", "batch_size=2")
    code = code.replace("    seen +=", "    batches.append(batch.numpy())\n    seen +=")

    def batches(seen: int, rank: int) -> list[np.ndarray]:
        own = code.replace("seen = 0", f"seen = {seen}").replace("rank=0", f"rank={rank}")
        defined: dict[str, list[np.ndarray]] = {"batches": []}
        exec(compile(own, "page", "exec"), defined)
        return defined["batches"]

    whole, rest, other = batches(0, 0), batches(2, 0), batches(0, 1)
    assert [len(batch) for batch in whole] == [2, 2]
    np.testing.assert_array_equal(np.concatenate(whole)[2:], np.concatenate(rest))
    known = [sample.points.tobytes() for sample in api.open_dataset(toy_folder).split("train")]
    shown = {points.tobytes() for points in np.concatenate([*whole, *other])}
    assert shown == set(known)


@pytest.mark.parametrize("offset", [512, 10_000_000, -512])
def test_offset_that_holds_no_sample_is_named(copied: Path, offset: int) -> None:
    change_index(copied, "offset", offset)
    with pytest.raises(ConfigError, match=rf"mine/data/train/toy-1_2_0-train-000000\.tar: .*at byte {offset}"):
        api.open_dataset(copied).split("train")[0]


def test_row_of_another_sample_is_named(copied: Path) -> None:
    change_index(copied, "key", "blocks-99999")
    with pytest.raises(ConfigError, match="has blocks-00000 at byte 0, where the index states blocks-99999"):
        api.open_dataset(copied).split("train")[0]


@pytest.mark.parametrize("shard", ["../secret.tar", "/etc/secret.tar", "data/../../secret.tar"])
def test_index_that_leads_out_of_the_folder_is_refused(copied: Path, shard: str) -> None:
    change_index(copied, "shard", shard)
    with pytest.raises(ConfigError, match="outside the dataset's folder"):
        api.open_dataset(copied).split("train")


def test_missing_index_and_unknown_store_are_named(copied: Path) -> None:
    shutil.rmtree(copied.with_name("mine-index"))
    with pytest.raises(ConfigError, match=r"mine-index/toy\.parquet: the index cannot be read"):
        api.open_dataset(copied).split("train")
    with pytest.raises(ConfigError, match=r"nowhere://bucket/toy: Protocol not known: nowhere"):
        api.open_dataset("nowhere://bucket/toy")
    with pytest.raises(ValueError, match="'dev' is no split; take one of train, val, test"):
        api.open_dataset(copied).split("dev")


def test_folder_without_a_dataset_is_refused_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"is no finished dataset: it has no manifest\.json; make it with") as caught:
        api.open_dataset(tmp_path / "none")
    assert caught.value.__suppress_context__
