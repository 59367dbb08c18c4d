"""Check that the physical validity of a sample is what its record says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.paths import DatasetPaths
from stages.shape.collection.audit import Audit
from stages.shape.collection.discovery import languages
from stages.shape.collection.packaged import PackagedSample
from stages.shape.collection.pairs import CONTACTS, JOINTS
from stages.shape.geometry.components import connected_components
from stages.shape.physics.judge import fall_fields, judge_of, physical_fields
from stages.shape.physics.settling import Fall
from stages.validity.settings import ValidityConfig

FIELD_ROUNDING = 2e-6
"""Numbers of a record are rounded to this."""
RELATIVE_TOLERANCE = 1e-3
"""Relative error of numbers computed from rounded poses."""


def contradictions(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for each two fields that cannot both be true."""
    yield from _pair_faults(sample)
    physics, parts = sample.record["physics"], len(sample.shape)
    push = _config(sample).push
    if physics["rooted"] != (physics["floating"] == 0):
        yield f"its json says rooted: {physics['rooted']} and counts {physics['floating']} floating parts"
    if physics["stable"] != (physics["margin"] >= push - FIELD_ROUNDING):
        yield f"its json says stable: {physics['stable']}, with a margin of {physics['margin']} for a push of {push}"
    if not (0 <= physics["floating"] <= parts and 1 <= physics["components"] <= parts):
        yield "its json counts more pieces or floating parts than it has parts"
    if not -1 <= physics["weakest"] < parts:
        yield "its json names a weakest part that does not exist"
    if _config(sample).falls:
        yield from _fall_faults(physics, parts)


def _fall_faults(physics: Mapping[str, Any], parts: int) -> Iterator[str]:
    if physics["falls"] != Fall(physics["fall_degrees"], physics["fallen"]).falls:
        yield f"its json says falls: {physics['falls']}, with a tilt of {physics['fall_degrees']} degrees"
    if not physics["rooted"] and not physics["falls"]:
        yield "its json says that it does not fall, and that a part is not connected to the ground"
    if not -1 <= physics["fallen"] < parts:
        yield "its json names a fallen part that does not exist"


def recomputed_validity_faults(sample: PackagedSample, _: DatasetPaths) -> Iterator[str]:
    """Yield a sentence for each field that statics computes otherwise, and for wrong contacts."""
    shape, recorded = sample.shape, sample.record["physics"]
    judge = judge_of(shape.meshes, shape.up, _config(sample))
    validity = judge.validity(shape.assembly)
    if validity.joints.tolist() != sample.arrays[JOINTS].T.tolist():
        yield "its joints are not the pairs that statics counts as connected"
    fields = physical_fields(validity)
    if _config(sample).falls:
        fields |= fall_fields(judge.fall(shape.assembly, validity.joints))
    for name, value in fields.items():
        if isinstance(value, float):
            wrong = abs(value - recorded[name]) > max(FIELD_ROUNDING, RELATIVE_TOLERANCE * abs(value))
        else:
            wrong = value != recorded[name]
        if wrong:
            yield f"its json says {name}: {recorded[name]}, and statics {value}"
    if not languages()[sample.record["language"]].graphs:
        alone = replace(shape.assembly, edges=np.empty((0, 2), dtype=np.int32))
        touching = judge.contacts(alone, sample.record["contact_tolerance"]).tolist()
        lost = [pair for pair in shape.assembly.edges.tolist() if pair not in touching]
        if lost:
            yield f"parts {lost[0]} keep a contact and are farther apart than its contact tolerance"
        if touching != sample.contacts.tolist():
            missing = [pair for pair in touching if pair not in sample.contacts.tolist()]
            named = f"parts {missing[0]} touch and are not" if missing else "parts that do not touch are"
            yield f"{named} recorded as neighbours"


def _pair_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield faults of contacts and joints: they are ordered pairs of parts, and the joints make the components."""
    parts, physics = len(sample.record["parts"]), sample.record["physics"]
    for member in (CONTACTS, JOINTS):
        pairs = sample.arrays[member]
        if pairs.ndim != 2 or len(pairs) != 2 or pairs.dtype != np.int32:
            yield f"{member} is not an array int32 (2, m)"
            return
        if (pairs[0] >= pairs[1]).any() or (pairs < 0).any() or (pairs >= parts).any():
            yield f"{member} holds entries that are not pairs of its parts"
            return
        keys = pairs[0].astype(np.int64) * parts + pairs[1]
        if (np.diff(keys) <= 0).any():
            yield f"{member} is not in order, or has a pair twice"
    if connected_components(parts, sample.arrays[JOINTS].T).max() + 1 != physics["components"]:
        yield "its joints do not make as many components as physics says"


def _config(sample: PackagedSample) -> ValidityConfig:
    return ValidityConfig.model_validate(sample.sections["validity"])


AUDIT = Audit(faults=contradictions, recheck=recomputed_validity_faults)
