"""Output in an object store: a run works in a local folder, and what users load goes up as soon as it is whole.

The room that knows stores holds a `remote_output.py` with `open_remote_output(url, dataset, paths) -> RemoteOutput`.
"""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Protocol, cast

from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths
from pipeline.registry import folders_with

FILE = "remote_output.py"


class RemoteOutput(Protocol):
    """Where a run sends its finished shards."""

    def shard_done(self, stage: str, shard: str) -> None:
        """Send the files of a shard that users load, if it has some; returns before they are sent."""

    def finish(self, whole: bool) -> None:
        """Wait for what is being sent; where the dataset is `whole`, send what else users load.

        Raises Fatal where the store refuses.
        """


def store_url(out: Path) -> str:
    """Return the URL that an output folder is; empty for a local folder. A path has lost one of two slashes."""
    return re.sub(r"^(\w+):/+", r"\1://", str(out)) if re.match(r"\w+:/", str(out)) else ""


def open_remote_output(url: str, dataset: str, paths: DatasetPaths) -> RemoteOutput:
    """Return the output of a dataset below a URL. Raises ConfigError, with the remedy, where nothing can be written."""
    rooms = folders_with("stages", FILE)
    if not rooms:
        raise ConfigError(f"OUT={url}: no room of this project writes to stores; name a local folder")
    room = importlib.import_module(f"stages.{rooms[0]}.{FILE.removesuffix('.py')}")
    return cast(RemoteOutput, room.open_remote_output(url, dataset, paths))
