"""Read captions back into facts, and check that each of them holds for the shape."""

from __future__ import annotations

import json
from collections.abc import Iterator

from pipeline.paths import DatasetPaths
from stages.captions.grammar import CaptionParser
from stages.captions.members import CAPTION
from stages.captions.placement import placement_of
from stages.captions.truth import holds, witnessed
from stages.captions.words import label_nouns, source_noun
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample


def caption_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for each length that is missing or empty."""
    lengths = sample.sections.get("captions", {}).get("lengths", ())
    if not lengths:
        return
    texts = json.loads(sample.members[CAPTION])
    if set(texts) != set(lengths):
        yield f"its captions are {', '.join(texts)}, not {', '.join(sorted(lengths))}"
    for length, text in texts.items():
        if not isinstance(text, str) or not text:
            yield f"its {length} caption is empty"


def false_sentences(sample: PackagedSample, _: DatasetPaths) -> Iterator[str]:
    """Yield a sentence for each statement of a caption that is not of the grammar, or does not hold."""
    if CAPTION not in sample.members:
        return
    shape, record = sample.shape, sample.record
    nouns = label_nouns(shape.used_labels)
    noun = source_noun(record["kit"], shape.used_labels, sample.sections.get("captions", {}).get("nouns", {}))
    parser = CaptionParser(noun, list(nouns.values()))
    placement = placement_of(record["producer"], record["kit"])
    seen = witnessed(shape, sample.contacts, record["physics"], nouns, noun, placement)
    for length, text in json.loads(sample.members[CAPTION]).items():
        try:
            facts = parser.facts(text)
        except ValueError as error:
            yield f"its {length} caption cannot be read: {error}"
            continue
        for fact in facts:
            if not holds(fact, seen):
                yield f"its {length} caption says {fact.kind} {' '.join(fact.about)}, which does not hold"


AUDIT = Audit(faults=caption_faults, recheck=false_sentences)
