"""What stage `captions` adds to every sample."""

from __future__ import annotations

from pipeline.config import Config
from stages.captions.settings import CaptionsConfig
from stages.shape.collection.members import Member, Members

CAPTION = "caption.json"


def _members(config: Config) -> tuple[Member, ...]:
    lengths = config.section(CaptionsConfig).lengths
    if not lengths:
        return ()
    text = (
        f"Descriptions in English: {', '.join(f'`{length}`' for length in lengths)}. A grammar writes them from facts "
        "that hold for the shape; nouns are the labels of the parts, and the source's name."
    )
    return (Member(CAPTION, text),)


def _tasks(config: Config) -> tuple[str, ...]:
    return ("text-to-3d",) if config.section(CaptionsConfig).lengths else ()


MEMBERS = Members(of=_members, tasks=_tasks, checks=("captions",))
