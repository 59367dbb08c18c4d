"""What tables may need of a dataset, each with what to do where it is missing."""

from __future__ import annotations

from eval.evaluation import Need
from eval.subject import Subject
from stages.shape.collection.declared import language_of, producers

__all__ = ["FINISHED", "KITS", "SEARCH", "trained_model"]


def _finished(subject: Subject) -> str:
    return "" if subject.manifest else f"no finished dataset in {subject.folder}; make dataset"


FINISHED = Need("a finished dataset", _finished)
"""`Subject.folder` holds a dataset."""


def _kits(subject: Subject) -> str:
    asked = [name for name, each in producers().items() if each.asked(subject.config)]
    if not any(language_of(name).graphs for name in asked):
        return f"{subject.config.name} is made of {', '.join(asked) or 'nothing'}, whose samples are no shape graphs"
    if not any(subject.places.stage("exemplars").root.glob("*.json")):
        return f"the kits are not in {subject.places.stage('exemplars').root}; make exemplars"
    return ""


KITS = Need("kits read by stage exemplars", _kits)
"""The samples are shape graphs, and the kits that they are of stand in the mill's folder."""


def _search(subject: Subject) -> str:
    records = subject.places.stage("variations").records
    return "" if any(records.glob("*-pool.json")) else f"no search has left its records in {records}; make variations"


SEARCH = Need("the records of a search", _search)
"""The mill's folder holds what the search of stage `variations` has found, round by round."""


def trained_model(name: str) -> Need:
    """A model of this name, trained on the dataset and published in `Subject.models`."""

    def missing(subject: Subject) -> str:
        folder = subject.models / name
        return "" if folder.is_dir() and any(folder.iterdir()) else f"no trained model in {folder}; make train"

    return Need(f"a trained model {name}", missing)
