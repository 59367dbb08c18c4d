"""A small dataset, and an S3 server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.paths import file_digest
from pipeline.shards import ShardWriter, array_bytes, json_bytes
from stages.package.index import tar_bytes
from stages.package.manifest import checksums
from stages.verification.verified import record_verification

SPLITS = ("train", "val", "test")


def make_dataset(folder: Path, name: str = "small", version: str = "1.0.0", shards: int = 6, points: int = 64) -> Path:
    """Write a dataset with two samples a shard, and the record of its verification; return its folder."""
    folder.mkdir(parents=True)
    rng, rows = np.random.default_rng(0), []
    for number in range(shards):
        split = SPLITS[number % 3]
        path = f"data/{split}/{name}-{version.replace('.', '_')}-{split}-{number // 3:06d}.tar"
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        with open(folder / path, "wb") as stream, ShardWriter(stream) as writer:
            for key in (f"{name}-{number}0", f"{name}-{number}1"):
                members = {"json": json_bytes({}), "points.npy": array_bytes(rng.random((points, 3)))}
                writer.write(key, members)
                rows.append(
                    {"key": key, "split": split, "shard": path, "offset": writer.offsets[key]}
                    | {"bytes": tar_bytes(members)}
                )
    index = folder.with_name(f"{folder.name}-index") / f"{name}.parquet"
    index.parent.mkdir()
    pq.write_table(pa.Table.from_pylist(rows), index)
    about = {"path": f"../{name}-index/{name}.parquet", "sha256": file_digest(index)}
    facts = {"name": name, "version": version, "samples": len(rows), "index": about}
    (folder / "manifest.json").write_bytes(json_bytes(facts))
    (folder / "classes.json").write_bytes(json_bytes([{"id": 0, "name": "block"}]))
    (folder / "README.md").write_text(f"# {name} {version}\n", encoding="utf-8")
    files = {str(path.relative_to(folder)): file_digest(path) for path in folder.rglob("*") if path.is_file()}
    (folder / "checksums.txt").write_text(checksums(files), encoding="utf-8")
    record_verification(folder, has_faults=False)
    return folder


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A dataset of six shards, verified."""
    return make_dataset(tmp_path / "small")


@pytest.fixture(scope="package")
def bucket() -> Iterator[str]:
    """The URL of a bucket of an S3 server on this machine; the environment says where it is."""
    import s3fs
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        patch.setenv("AWS_ACCESS_KEY_ID", "me")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        s3fs.S3FileSystem.clear_instance_cache()
        s3fs.S3FileSystem().mkdir("bucket")
        yield "s3://bucket"
        s3fs.S3FileSystem.clear_instance_cache()
    server.stop()
