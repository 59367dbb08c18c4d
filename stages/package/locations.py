"""Where datasets are stored: folders and object stores, by fsspec."""

from __future__ import annotations

from typing import Any

from pipeline.errors import ConfigError
from pipeline.package_groups import missing_group


def file_system(location: str) -> tuple[Any, str]:
    """Return the fsspec file system of a path or URL, and the path of the location in it.

    location: a path, or a URL such as `s3://bucket/castle`, `gs://...`, `az://...` or `hf://organization/name`.

    fsspec keeps one file system a process and store, and none of them survives a fork. So ask again in every call, and
    store the location. Raises ConfigError for an unknown kind of URL, and where the package for a kind is missing.
    """
    from fsspec.core import url_to_fs

    kind, _, rest = location.partition("://")
    if kind == "hf" and not rest.startswith("datasets/"):
        location = f"hf://datasets/{rest}"
    try:
        files, path = url_to_fs(location)
    except (ImportError, ValueError) as error:
        raise missing_group(error.__cause__) or ConfigError(f"{location}: {error}") from error
    return files, path.rstrip("/")


def index_location(location: str, manifest_path: str) -> str:
    """Return where the index of a dataset is: in a sibling folder named after the dataset's.

    manifest_path: path of the index in the manifest; its last step alone is used
    """
    folder = location.rstrip("/")
    return f"{folder}-index/{manifest_path.rpartition('/')[2]}"
