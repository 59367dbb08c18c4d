"""One split of a dataset with random access, by the offsets in the index."""

from __future__ import annotations

import io
import tarfile
from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import overload

from pipeline.errors import ConfigError
from pipeline.shards import read_shard
from stages.package.dataset_sample import DatasetSample
from stages.package.locations import file_system

INDEX_COLUMNS = ("key", "shard", "offset", "bytes")


class DatasetSplit(Sequence[DatasetSample]):
    """The samples of a split in the order of the index. Each is read without the rest of its shard.

    It has what torch asks of a map-style dataset. Worker processes may share it, forked or spawned: it holds the index
    as arrays and no open file.
    """

    def __init__(self, location: str, index: str, split: str) -> None:
        """Read the rows of a split from the index.

        location: path or URL of the dataset's folder
        index: path or URL of its index
        split: `train`, `val` or `test`

        Raises ConfigError where the index cannot be read or names a shard outside the folder.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        self.location, self.split = location, split
        files, path = file_system(index)
        try:
            rows = pq.read_table(
                path,
                filesystem=files,
                columns=list(INDEX_COLUMNS),
                filters=[("split", "=", split)],
                partitioning=None,
                read_dictionary=["shard"],
            )
        except (OSError, pa.ArrowException) as error:
            raise ConfigError(f"{index}: the index cannot be read: {error}") from None
        rows = rows.unify_dictionaries().combine_chunks()
        shards = rows["shard"].combine_chunks()
        self._keys = rows["key"].combine_chunks()
        self._shards: list[str] = shards.dictionary.to_pylist()
        self._shard_of = shards.indices.to_numpy()
        self._offsets, self._sizes = rows["offset"].to_numpy(), rows["bytes"].to_numpy()
        for shard in self._shards:
            if PurePosixPath(shard).is_absolute() or ".." in PurePosixPath(shard).parts:
                raise ConfigError(f"{index}: names the shard {shard!r}, which is outside the dataset's folder")

    def __len__(self) -> int:
        return len(self._offsets)

    @overload
    def __getitem__(self, index: int) -> DatasetSample: ...

    @overload
    def __getitem__(self, index: slice) -> list[DatasetSample]: ...

    def __getitem__(self, index: int | slice) -> DatasetSample | list[DatasetSample]:
        """Return the sample at a place of the split, or those of a slice.

        Raises IndexError, and ConfigError where the shard does not hold the sample that the index states.
        """
        if isinstance(index, slice):
            return [self[place] for place in range(*index.indices(len(self)))]
        place = range(len(self))[int(index)]
        key, shard = self._keys[place].as_py(), self._shards[self._shard_of[place]]
        offset, size = int(self._offsets[place]), int(self._sizes[place])
        files, root = file_system(self.location)
        try:
            content = files.cat_file(f"{root}/{shard}", start=offset, end=offset + size)
            ((found, members),) = read_shard(io.BytesIO(content))
        except (OSError, ValueError, tarfile.TarError) as error:
            raise ConfigError(f"{self.location}/{shard}: {key} cannot be read at byte {offset}: {error}") from None
        if found != key or len(content) != size:
            raise ConfigError(f"{self.location}/{shard}: has {found} at byte {offset}, where the index states {key}")
        return DatasetSample(key, self.split, members)
