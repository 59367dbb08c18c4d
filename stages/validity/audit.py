"""Is the physical validity of a sample what its record says?"""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.places import Places
from stages.shape.collection.audit import Audit
from stages.shape.collection.declared import languages
from stages.shape.collection.packaged import Packaged
from stages.shape.physics.judge import judge_of, physical_fields
from stages.shape.physics.settings import PhysicsConfig

__all__ = ["AUDIT", "contradictions", "judged_anew"]

ROUNDED = 2e-6
"""Numbers of a record are rounded to so many."""
SLACK = 1e-3
"""As a share of the number, so near a number is that is computed from rounded poses."""


def contradictions(sample: Packaged) -> Iterator[str]:
    """A sentence for each two fields that cannot both be true."""
    physics, parts = sample.record["physics"], len(sample.shape)
    push = _config(sample).push
    if physics["rooted"] != (physics["floating"] == 0):
        yield f"its json says rooted: {physics['rooted']} and counts {physics['floating']} floating parts"
    if physics["stable"] != (physics["margin"] >= push - ROUNDED):
        yield f"its json says stable: {physics['stable']}, with a margin of {physics['margin']} for a push of {push}"
    if not (0 <= physics["floating"] <= parts and 1 <= physics["components"] <= parts):
        yield "its json counts more pieces or floating parts than it has parts"
    if not -1 <= physics["weakest"] < parts:
        yield "its json names a weakest part that is not there"


def judged_anew(sample: Packaged, _: Places) -> Iterator[str]:
    """A sentence for each field that statics finds otherwise, and for contacts that are none."""
    shape, recorded = sample.shape, sample.record["physics"]
    judge = judge_of(shape.meshes, shape.up, _config(sample))
    found = physical_fields(judge.validity(shape.assembly))
    for name, value in found.items():
        if isinstance(value, float):
            wrong = abs(value - recorded[name]) > max(ROUNDED, SLACK * abs(value))
        else:
            wrong = value != recorded[name]
        if wrong:
            yield f"its json says {name}: {recorded[name]}, and statics {value}"
    if not languages()[sample.record["language"]].graphs:
        touching = judge.contacts(shape.assembly).tolist()
        if touching != sample.contacts.tolist():
            missing = [pair for pair in touching if pair not in sample.contacts.tolist()]
            named = f"parts {missing[0]} touch and are not" if missing else "parts that do not touch are"
            yield f"{named} recorded as neighbours"


def _config(sample: Packaged) -> PhysicsConfig:
    return PhysicsConfig.model_validate(sample.sections["validity"])


AUDIT = Audit(faults=contradictions, anew=judged_anew)
