"""What stage `exports` adds to every sample: one archive a format."""

from __future__ import annotations

from pipeline.config import Config
from stages.exports.settings import ExportsConfig
from stages.shape.collection.archive import archive_name
from stages.shape.collection.members import Member, Members

CONTENTS = {
    "urdf": "URDF, one file for each piece of the shape, with meshes",
    "mjcf": "MJCF of MuJoCo, with meshes",
    "usd": "OpenUSD with the physics schemas",
    "obj": "Wavefront OBJ with materials",
}


def _members(config: Config) -> tuple[Member, ...]:
    formats = config.section(ExportsConfig).formats
    return tuple(Member(archive_name(kind), f"{CONTENTS[kind]}: an archive of files.") for kind in formats)


MEMBERS = Members(of=_members)
