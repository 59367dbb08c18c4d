"""`OUT` in a store: shards go up as they are made, a killed run goes on, and what cannot work is refused at once."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stages import api
from tests.command import shapemill
from tests.stages.publishing.test_store import ROOT, contents

CONFIG = """
name: heaps
primitives: {samples: 12, splits: {shards: 6}}
points: {uniform: 64}
sketches: {size: 64, views: [{name: right, azimuth: 35.0, elevation: 15.0}]}
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "heaps.yaml"
    path.write_text(CONFIG, encoding="utf-8")
    return path


def test_killed_run_goes_on_and_the_store_has_the_bytes_of_the_folder(
    config: Path, tmp_path: Path, bucket: str
) -> None:
    import s3fs

    server, work = s3fs.S3FileSystem(use_listings_cache=False), tmp_path / "work"
    run = ("run", "--config", config, "--out", f"{bucket}/made", "--work", work, "--workers", "2")
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline", *map(str, run)], cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL
    )
    while len(server.find("bucket/made")) < 3:
        assert process.poll() is None
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = server.find("bucket/made", detail=True)
    assert not server.exists("bucket/made/heaps/manifest.json")
    code, text = shapemill(*run)
    assert code == 0, text
    assert f"{bucket}/made/heaps: shards go there as soon as they are whole; records and intermediates are in" in text
    assert f'open it with stages.api.open_dataset("{bucket}/made/heaps")' in text
    assert contents(f"{bucket}/made/heaps") == contents(str(work / "heaps"))
    after = server.find("bucket/made", detail=True)
    assert {path: after[path]["LastModified"] for path in before if path in after} == {
        path: facts["LastModified"] for path, facts in before.items()
    }
    assert list(api.open_dataset(f"{bucket}/made/heaps")) == list(api.open_dataset(work / "heaps"))
    code, text = shapemill(*run)
    assert (code, "0 sent now" in text) == (0, True), text


def test_file_lost_in_the_store_is_sent_again(config: Path, tmp_path: Path) -> None:
    run = ("run", "--config", config, "--out", "memory://made", "--work", tmp_path / "work", "--workers", "1")
    code, text = shapemill(*run)
    assert code == 0, text
    import fsspec

    files = fsspec.filesystem("memory")
    lost = files.find("/made/heaps/data/train")[0]
    files.rm_file(lost)
    code, text = shapemill(*run)
    assert (code, "1 sent now" in text) == (0, True), text
    assert contents("memory://made/heaps") == contents(str(tmp_path / "work/heaps"))


def test_store_that_takes_no_files_is_refused_before_the_run(
    config: Path, tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import s3fs

    work = tmp_path / "work"

    def refusal(out: str) -> str:
        s3fs.S3FileSystem.clear_instance_cache()
        code, text = shapemill("run", "--config", config, "--out", out, "--work", work)
        assert code == 2, text
        assert not work.exists()
        return text

    assert "OUT=s3://nobody/made/heaps: cannot be written to" in refusal("s3://nobody/made")
    assert "make the bucket first, or name another" in refusal("s3://nobody/made")
    assert "run `make publish DEST=hf://makers/heaps`" in refusal("hf://makers")
    with monkeypatch.context() as patch:
        patch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
        patch.setenv("AWS_MAX_ATTEMPTS", "1")
        assert "check the network and AWS_ENDPOINT_URL" in refusal("s3://bucket/made")
    with monkeypatch.context() as patch:
        patch.delenv("AWS_ACCESS_KEY_ID")
        patch.delenv("AWS_SECRET_ACCESS_KEY")
        patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
        patch.setenv("HOME", str(tmp_path))
        assert "set the credentials of the store" in refusal("s3://bucket/made")
    s3fs.S3FileSystem.clear_instance_cache()
