"""Check that the archives of a sample are whole, and hold the files that its shape makes."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.paths import DatasetPaths
from stages.exports.settings import ExportsConfig
from stages.shape.collection.archive import archive_files, archive_name
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shape.collection.pairs import JOINTS, pairs_of


def archive_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for each archive that cannot be read."""
    for kind in _config(sample).formats:
        try:
            archive_files(sample.members[archive_name(kind)])
        except (ValueError, KeyError) as error:
            yield f"{archive_name(kind)} cannot be read: {error}"


def foreign_files(sample: PackagedSample, _: DatasetPaths) -> Iterator[str]:
    """Yield a sentence for each archive that has other files than the shape makes now."""
    from stages.export.formats import shape_files

    config, joints = _config(sample), pairs_of(sample.members[JOINTS])
    for kind in config.formats:
        expected = shape_files(kind, sample.key, sample.shape, joints, config.assumed)
        files = archive_files(sample.members[archive_name(kind)])
        if list(files) != list(expected):
            yield f"{archive_name(kind)} has the files {', '.join(files)}, not {', '.join(expected)}"
        elif [len(content.split()) for content in files.values()] != [
            len(content.split()) for content in expected.values()
        ]:
            yield f"{archive_name(kind)} has other contents than its shape makes"


def _config(sample: PackagedSample) -> ExportsConfig:
    return ExportsConfig.model_validate(sample.sections.get("exports", {}), strict=False)


AUDIT = Audit(faults=archive_faults, recheck=foreign_files)
