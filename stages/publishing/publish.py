"""`make publish`: put a finished, verified dataset where people load it."""

from __future__ import annotations

from pathlib import Path

from pipeline.display import counting
from pipeline.errors import Fatal
from stages.publishing.hub import Hub
from stages.publishing.publication import read_publication
from stages.publishing.store import Store, failed_requests


def publish_dataset(folder: Path, destination: str, dry_run: bool) -> None:
    """Send the files of a dataset that are not at a destination with the same bytes, and print what is done.

    destination: folder or URL of the dataset, such as `s3://bucket/castle` or `hf://organization/castle`
    dry_run: send nothing, and list what would be sent

    Raises ConfigError for a dataset that was not verified without faults and a destination that has another one, and
    Fatal where the destination refuses.
    """
    publication = read_publication(folder)
    try:
        place = (Hub if destination.startswith("hf://") else Store)(destination, publication)
        files = place.missing()
        total = sum(file.size for file in files)
        count = len(publication.files) + 1
        print(f"{publication.name}: {count:,} files; {count - len(files):,} are at {destination} already")
        if dry_run:
            for file in files:
                print(f"  {file.path}  {file.size:,} bytes")
            print(f"{len(files):,} files of {total:,} bytes would be sent")
            return
        with counting("publish", total, "bytes") as show:
            place.send(files, show)
    except failed_requests() as error:
        raise Fatal(f"{destination}: {error}") from error
    print(f'sent {len(files):,} files of {total:,} bytes; open it with stages.api.open_dataset("{destination}")')
