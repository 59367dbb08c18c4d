"""What tables may need of a dataset, each with what to do where it is missing."""

from __future__ import annotations

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Requirement
from stages.shape.collection.discovery import language_of, producers
from stages.training.checkpoint import weights_of_kind


def _finished(subject: DatasetRun) -> str:
    return "" if subject.manifest else f"no finished dataset in {subject.folder}; make dataset"


FINISHED_DATASET = Requirement("a finished dataset", _finished)
"""`Subject.folder` holds a dataset."""


def _kits(subject: DatasetRun) -> str:
    asked = [name for name, each in producers().items() if each.asked(subject.config)]
    if not any(language_of(name).graphs for name in asked):
        return f"{subject.config.name} is made of {', '.join(asked) or 'nothing'}, whose samples are no shape graphs"
    if not any(subject.paths.stage("exemplars").root.glob("*.json")):
        return f"the kits are not in {subject.paths.stage('exemplars').root}; make exemplars"
    return ""


KITS = Requirement("kits read by stage exemplars", _kits)
"""The samples are shape graphs, and the kits that they are of stand in the mill's folder."""


def _exemplars(subject: DatasetRun) -> str:
    if any(subject.paths.stage("grammars").root.glob("*.json")):
        return ""
    return _kits(subject)


EXEMPLARS = Requirement("the exemplars of shapes", _exemplars)
"""The kits or the grammars that the samples are of stand in the mill's folder."""


def _search(subject: DatasetRun) -> str:
    records = subject.paths.stage("variations").records
    if subject.config.keep == "dataset":
        return "what the search found was let go of; keep: all in the config, and make variations"
    return "" if any(records.glob("*-pool.json")) else f"no search has left its records in {records}; make variations"


SEARCH = Requirement("the records of a search", _search)
"""The mill's folder holds what the search of stage `variations` has found, round by round."""


def _trained(kind: str, what: str) -> Requirement:
    """The need of weights of a kind in `Subject.models`."""
    return _trained_of((kind,), what)


def _trained_of(kinds: tuple[str, ...], what: str) -> Requirement:
    """The need of weights of any of some kinds."""

    def missing(subject: DatasetRun) -> str:
        there = any(weights_of_kind(subject.models, kind) for kind in kinds)
        return "" if there else f"no trained {what} in {subject.models}; make train"

    return Requirement(f"a trained {what}", missing)


STRING_VAE = _trained("string_vae", "string VAE")
EDGE_CATEGORIES = _trained("edge_categories", "model of edge categories")
RECOVERY = _trained("recovery", "recovery model")
PROGRAM_WRITERS = _trained_of(
    ("program_vae", "program_lm", "cuboid_rnn", "part_graph_vae"),
    "model of ShapeAssembly programs, or of their cuboids",
)


def _program(subject: DatasetRun) -> str:
    if producers()["programs"].asked(subject.config):
        return ""
    return f"{subject.config.name} is not made of a curve program; take configs/chairs.yaml, or another of a program"


CURVE_PROGRAM = Requirement("a dataset of a curve program", _program)
"""The config asks for shapes of a curve program; nothing need be made yet."""


def _programs(subject: DatasetRun) -> str:
    if subject.config.keep == "dataset":
        return "the programs were let go of; keep: all in the config, and make shapeassembly"
    root = subject.paths.stage("shapeassembly").root
    return "" if any(root.glob("*-train-*.tar")) else f"the programs are not in {root}; make shapeassembly"


PROGRAMS = Requirement("ShapeAssembly programs", _programs)
"""The mill's folder holds the programs that models have learnt from."""


def _corpus(subject: DatasetRun) -> str:
    return "" if subject.corpus.is_dir() else f"no corpus in {subject.corpus}; make strings"


CORPUS = Requirement("the corpus of its strings", _corpus)
"""`Subject.corpus` holds the strings of all samples."""
