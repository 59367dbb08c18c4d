"""Code of a shard: an edit that may change bytes rebuilds shards, and no other edit does."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pipeline.code import _read, entry_points, transitive_imports
from pipeline.config import Config, StrictModel
from pipeline.errors import Fatal
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from pipeline.run import RunResult, run_stage, run_stages

STONE_STAGE = '''
"""Millstones."""
from __future__ import annotations
from pipeline.config import StrictModel
from pipeline.stage import Outcome, Plan, Shard, Stage, Task

class StoneConfig(StrictModel):
    """How it is ground."""
    sharpens: bool = False

def plan(plan: Plan) -> list[Shard]:
    return [Shard("coarse"), Shard("fine", code=("barn.sieves.fine",))]

def run_shard(task: Task) -> Outcome:
    """Grinds."""
    from barn.stone.grit import GRIT
    if task.config.section(StoneConfig).sharpens:
        from pathlib import Path
        import barn.stone.grit
        Path(barn.stone.grit.__file__).write_text("GRIT = 8",encoding="utf-8")
    with task.output(f"{task.shard.name}.txt") as stream:
        stream.write(b"dust" * GRIT)
    return Outcome(1)

STAGE = Stage("stone", __name__, StoneConfig, (), plan, run_shard, lambda _: 0)
'''

Write = Callable[[str, str], None]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Write]:
    """Writes a file of a project that can be imported, and the `__init__.py` of every folder on the way."""
    monkeypatch.syspath_prepend(tmp_path / "src")

    def write(name: str, text: str) -> None:
        path = tmp_path / "src" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        for folder in path.parents:
            if folder == tmp_path / "src":
                break
            (folder / "__init__.py").touch()
        path.write_text(text, encoding="utf-8")

    yield write
    for module in [module for module in sys.modules if module.partition(".")[0] in {"barn", "yard"}]:
        del sys.modules[module]


def names(*starts: str) -> set[str]:
    return {module for module in transitive_imports(starts) if not module.startswith("pipeline")}


def test_every_kind_of_import_is_followed_anywhere_in_a_file(write: Write) -> None:
    write("barn/hall.py", "import barn.stairs.steps\nfrom barn import cellar\ndef late():\n    from . import attic\n")
    write("barn/stairs/steps.py", "from ..garden import *\nfrom yard.gate import Hinge as latch\n")
    write("barn/garden.py", "import numpy, json, nowhere\nif True:\n    import yard.shed as shed\n")
    for name in ("barn/cellar.py", "barn/attic.py", "barn/unused.py", "yard/gate.py", "yard/shed.py"):
        write(name, "")
    rooms = {"hall", "stairs", "stairs.steps", "cellar", "attic", "garden"}
    assert names("barn.hall") == {"barn", "yard", "yard.gate", "yard.shed", *(f"barn.{room}" for room in rooms)}
    assert names("yard.gate") == {"yard", "yard.gate"}


def test_package_may_have_several_folders(write: Write, tmp_path: Path) -> None:
    write("barn/__init__.py", f"__path__.append({str(tmp_path / 'annex')!r})")
    write("barn/hall.py", "import barn.guests")
    (tmp_path / "annex").mkdir()
    (tmp_path / "annex/guests.py").write_text("BEDS = 2", encoding="utf-8")
    __import__("barn")
    assert names("barn.hall") == {"barn", "barn.hall", "barn.guests"}


def test_missing_start_is_reported(write: Write) -> None:
    with pytest.raises(ValueError, match=r"no Python file of module barn\.none"):
        transitive_imports(["barn.none"])


PLAIN = "import os\n\ndef height(steps):\n    return 0.5 * steps\n"


@pytest.mark.parametrize(
    "edited",
    [
        "# stairs\nimport os  # needed\n\n\ndef height(steps):\n    # half a metre\n    return 0.5*steps\n",
        '"""Stairs."""\nimport os\ndef height(steps):\n    """m."""\n    return (\n  0.5 * steps)\n"""So."""\n',
    ],
)
def test_comment_docstring_and_format_change_nothing(write: Write, edited: str) -> None:
    write("barn/stairs.py", PLAIN)
    before = transitive_imports(["barn.stairs"])
    write("barn/stairs.py", edited)
    assert transitive_imports(["barn.stairs"]) == before


def test_import_for_types_alone_does_not_count(write: Write) -> None:
    text = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from barn.hall import Hall\nelse:\n    Hall = 1\n"
    write("barn/stairs.py", text)
    write("barn/hall.py", "")
    before = transitive_imports(["barn.stairs"])
    assert set(before) == {"barn", "barn.stairs"}
    write("barn/stairs.py", text.replace("import Hall", "import Hall, Door"))
    assert transitive_imports(["barn.stairs"]) == before


@pytest.mark.parametrize("edited", ["0.25 * steps", "0.5 * -steps", "'0.5' * steps", "0.5 * step"])
def test_every_word_of_code_counts(write: Write, edited: str) -> None:
    write("barn/stairs.py", PLAIN)
    before = transitive_imports(["barn.stairs"])
    write("barn/stairs.py", PLAIN.replace("0.5 * steps", edited))
    after = transitive_imports(["barn.stairs"])
    assert {module for module in before if before[module] != after[module]} == {"barn.stairs"}


def test_every_version_of_python_gives_the_same_digest(write: Write) -> None:
    """Python 3.12 added a field to functions and classes; the digest was taken on 3.11."""
    write("barn/loft.py", "class Hay:\n    def bales(self, count=3):\n        return f'{count:>9} bales'\n")
    assert transitive_imports(["barn.loft"])["barn.loft"] == "73faba45f050dbb8"


def test_declarations_in_the_folder_of_a_stage_count(write: Write) -> None:
    write("barn/stone/stage.py", "")
    write("barn/stone/language.py", "import barn.words")
    write("barn/stone/other.py", "")
    write("barn/words.py", "")
    start = entry_points("barn.stone.stage")
    assert names(*start) == {"barn", "barn.stone", "barn.stone.stage", "barn.stone.language", "barn.words"}


def grind(out: Path, sharpens: bool = False) -> RunResult:
    stages = find_stages("barn")
    section = stages["stone"].config.model_validate({"sharpens": sharpens})
    return run_stage("stone", stages, Config("toys", "1.0.0", 0, {"stone": section}, out), DatasetPaths(out, "toys"), 1)


@pytest.fixture
def edit(write: Write) -> Write:
    write("barn/stone/stage.py", STONE_STAGE)
    write("barn/stone/grit.py", "GRIT = 2")
    write("barn/sieves/fine.py", "MESH = 1")
    return write


def test_edit_rebuilds_what_imports_it_and_the_log_names_it(edit: Write, tmp_path: Path) -> None:
    assert grind(tmp_path).made == 2
    edit("barn/stone/grit.py", "GRIT = 2  # rough")
    assert grind(tmp_path).made == 0
    edit("barn/sieves/fine.py", "MESH = 3")
    assert grind(tmp_path).made == 1
    edit("barn/stone/grit.py", "GRIT = 4")
    assert grind(tmp_path).made == 2
    assert (tmp_path / ".work/toys/stone/coarse.txt").read_bytes() == b"dust" * 4
    log = (tmp_path / ".work/toys/log.txt").read_text(encoding="utf-8")
    assert "1 shard is rebuilt: changed: code (barn.sieves.fine)" in log
    assert "2 shards are rebuilt: changed: code (barn.stone.grit)" in log


def test_edit_while_a_stage_runs_stops_it_before_a_shard_is_committed(edit: Write, tmp_path: Path) -> None:
    with pytest.raises(Fatal, match=r"the code of stage stone was edited during the run \(barn\.stone\.grit\)"):
        grind(tmp_path, sharpens=True)
    assert not list((tmp_path / ".work/toys/stone").glob("*.txt"))


WALL_STAGE = """
from pipeline.config import StrictModel
from pipeline.stage import Outcome, Shard, Stage

def run_shard(task):
    from barn.{reads} import GRIT
    from pathlib import Path
    Path(__file__).parents[1].joinpath("late.py").write_text("GRIT = 8", encoding="utf-8")
    with task.output("stones.txt") as stream:
        stream.write(b"stone" * GRIT)
    return Outcome(1)

STAGE = Stage("{name}", __name__, StrictModel, {inputs}, lambda _: [Shard("stones")], run_shard, lambda _: 0)
"""


def test_edit_of_a_later_stage_stops_the_run_whose_workers_may_hold_the_old_code(write: Write, tmp_path: Path) -> None:
    write("barn/early.py", "GRIT = 2")
    write("barn/late.py", "GRIT = 2")
    write("barn/base/stage.py", WALL_STAGE.format(name="base", reads="early", inputs=()))
    write("barn/wall/stage.py", WALL_STAGE.format(name="wall", reads="late", inputs=("base",)))
    stages, paths = find_stages("barn"), DatasetPaths(tmp_path, "toys")
    config = Config("toys", "1.0.0", 0, dict.fromkeys(stages, StrictModel()), tmp_path)
    with pytest.raises(Fatal, match=r"the code of stage wall was edited during the run \(barn\.late\)"):
        run_stages(stages, stages, config, paths, 1)
    assert (tmp_path / ".work/toys/base/stones.txt").is_file()
    assert run_stages(stages, stages, config, paths, 1)["wall"].made == 1
    assert (tmp_path / ".work/toys/wall/stones.txt").read_bytes() == b"stone" * 8


def test_engine_code_counts_only_where_it_makes_bytes() -> None:
    for name, stage in find_stages().items():
        engine = {
            module
            for module in transitive_imports(entry_points(stage.module))
            if module.partition(".")[0] == "pipeline"
        }
        # package writes a digest of all code into the manifest, training one of a model's into its weights
        own = {"pipeline.code"} if name in ("package", "training") else set()
        # untrusted files are read in a child process, by these or by what they are made with
        reads = ("autoconfig", "exemplars", "grammars", "shapeassembly", "program_sampling", "abstraction", "training")
        own |= {"pipeline.bounded", "pipeline.termination"} if name in reads else set()
        # sampling says which group of packages is missing
        own |= {"pipeline.package_groups"} if name in ("program_sampling", "string_sampling") else set()
        assert engine == {"pipeline", "pipeline.errors", "pipeline.randomness", "pipeline.shards"} | own, name


def test_chair_does_not_import_the_vase() -> None:
    library = {f"stages.programs.library.{item}" for item in ("cabinet", "ceiling_lamp", "chair", "table", "vase")}
    assert not library & names(*entry_points("stages.programs.stage"))
    chair = names(*entry_points("stages.programs.stage", ["stages.programs.library.chair"]))
    assert library & chair == {"stages.programs.library.chair"}
    assert {"stages.programs.curves.part", "stages.programs.sampling"} <= chair


@pytest.mark.usefixtures("write")
class TestNotes:
    """Notes next to Python's compiled files hold digests, so that the next process parses nothing."""

    @pytest.fixture
    def digests(self, write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], dict[str, str]]:
        monkeypatch.setattr(sys, "dont_write_bytecode", False)

        def digests(text: str) -> dict[str, str]:
            """The digests that a process finds which sees the file for the first time."""
            _read.cache_clear()
            if text:
                write("barn/loft.py", text)
            return transitive_imports(["barn.loft"])

        return digests

    def note(self, tmp_path: Path) -> Path:
        (found,) = (tmp_path / "src/barn/__pycache__").glob("loft.*.imports.json")
        return found

    def test_note_follows_the_file(self, digests: Callable[[str], dict[str, str]], tmp_path: Path) -> None:
        first = digests("import barn.stone\nGRIT = 1")
        assert self.note(tmp_path).is_file()
        assert digests("") == first
        assert digests("import barn.stone\nGRIT = 2") != first
        assert digests("import barn.stone\nGRIT = 1") == first

    @pytest.mark.parametrize("corrupted", [b"", b"{", b"[]", b'{"key": 1}', b"\0" * 90])
    def test_corrupted_notes_are_ignored(
        self, digests: Callable[[str], dict[str, str]], tmp_path: Path, corrupted: bytes
    ) -> None:
        first = digests("GRIT = 1")
        whole = self.note(tmp_path).read_bytes()
        self.note(tmp_path).write_bytes(corrupted)
        assert digests("") == first
        assert self.note(tmp_path).read_bytes() == whole

    def test_notes_are_optional(self, digests: Callable[[str], dict[str, str]], tmp_path: Path) -> None:
        first = digests("GRIT = 1")
        folder = self.note(tmp_path).parent
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
        folder.write_text("a file stands where the folder would be", encoding="utf-8")
        assert digests("") == first
