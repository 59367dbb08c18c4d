"""What tables can require of a dataset, with the command that makes what is missing."""

from __future__ import annotations

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Requirement
from stages.shape.collection.discovery import language_of, producers
from stages.training.checkpoint import weights_of_kind


def _finished(run: DatasetRun) -> str:
    return "" if run.manifest else f"no finished dataset in {run.folder}; make dataset"


FINISHED_DATASET = Requirement("a finished dataset", _finished)


def _kits(run: DatasetRun) -> str:
    names = [name for name, producer in producers().items() if producer.is_requested(run.config)]
    if not any(language_of(name).graphs for name in names):
        return f"{run.config.name} is made by {', '.join(names) or 'nothing'}, whose samples are no shape graphs"
    if not any(run.paths.stage("exemplars").root.glob("*.json")):
        return f"the kits are not in {run.paths.stage('exemplars').root}; make exemplars"
    return ""


KITS = Requirement("kits read by stage exemplars", _kits)
"""The samples are shape graphs, and their kits are in the pipeline's folder."""


def _exemplars(run: DatasetRun) -> str:
    if any(run.paths.stage("grammars").root.glob("*.json")):
        return ""
    return _kits(run)


EXEMPLARS = Requirement("the exemplars of shapes", _exemplars)
"""The kits or grammars of the samples are in the pipeline's folder."""


def _search(run: DatasetRun) -> str:
    records = run.paths.stage("variations").records
    if run.config.keep == "dataset":
        return "the results of the search were pruned; set keep: all in the config, and make variations"
    return "" if any(records.glob("*-pool.json")) else f"no records of a search in {records}; make variations"


SEARCH = Requirement("the records of a search", _search)
"""The pipeline's folder holds what the search of stage `variations` found, round by round."""


def trained(description: str, *kinds: str) -> Requirement:
    """Require a trained model of any of some kinds in `DatasetRun.models`."""

    def missing(run: DatasetRun) -> str:
        found = any(weights_of_kind(run.models, kind) for kind in kinds)
        return "" if found else f"no trained {description} in {run.models}; make train"

    return Requirement(f"a trained {description}", missing)


STRING_VAE = trained("string VAE", "string_vae")
EDGE_CATEGORIES = trained("model of edge categories", "edge_categories")
RECOVERY = trained("recovery model", "recovery")
PROGRAM_MODELS = trained(
    "model of ShapeAssembly programs or of their cuboids", "program_vae", "program_lm", "cuboid_rnn", "part_graph_vae"
)


def _program(run: DatasetRun) -> str:
    if producers()["programs"].is_requested(run.config):
        return ""
    return f"{run.config.name} is not made by a curve program; use configs/chairs.yaml or another config of a program"


CURVE_PROGRAM = Requirement("a dataset of a curve program", _program)


def _programs(run: DatasetRun) -> str:
    if run.config.keep == "dataset":
        return "the programs were pruned; set keep: all in the config, and make shapeassembly"
    root = run.paths.stage("shapeassembly").root
    return "" if any(root.glob("*-train-*.tar")) else f"the programs are not in {root}; make shapeassembly"


PROGRAMS = Requirement("ShapeAssembly programs", _programs)
"""The pipeline's folder holds the programs that models were trained on."""


def _corpus(run: DatasetRun) -> str:
    return "" if run.corpus.is_dir() else f"no corpus in {run.corpus}; make strings"


CORPUS = Requirement("the corpus of its strings", _corpus)
