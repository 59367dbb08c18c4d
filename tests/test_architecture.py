"""Architecture rules, checked on the source: direction of imports, randomness, types, names of files."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

BANNED_NAMES = {"utils", "util", "helpers", "helper", "common", "misc"}

GLOBAL_RANDOMNESS = {"default_rng", "Generator", "SeedSequence", "PCG64", "BitGenerator"}
"""Names of `numpy.random` without global state."""

EXECUTING = {"pickle", "cloudpickle", "dill", "shelve", "marshal"}
"""Modules that execute what they read."""

REQUIRED_KEYWORDS = {"torch.load": "weights_only=True"} | {
    f"{module}.{function}": "allow_pickle=False" for module in ("np", "numpy") for function in ("load", "save")
}
"""Calls that execute what they read, or write what would be executed, without a keyword."""

CLOCKS = {"time.time", "time.time_ns", "datetime.now", "datetime.utcnow", "datetime.today", "date.today"}

HOOKS = {"build", "new_task", "new_model", "prepare", "batches", "batch_of", "main", "open_remote_output"}
"""Functions that every program of the library, kind of model and process has, or that the engine asks a room for."""

FRONT_DOORS = {ROOT / "stages" / "api.py", ROOT / "stages" / "package" / "standalone_verifier.py"}
"""The facade, whose functions are called like those behind it, and a program that imports nothing of ours."""

CODE = sorted(path for top in ("pipeline", "stages", "eval") for path in (ROOT / top).rglob("*.py"))
ALL = sorted([*CODE, *(ROOT / "tests").rglob("*.py")])


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def parsed(path: Path) -> ast.Module:
    """Parse a file, once for all rules."""
    return ast.parse(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module", autouse=True)
def forget_trees() -> Iterator[None]:
    """Tests after these need no syntax trees, which would slow down every full garbage collection."""
    yield
    parsed.cache_clear()


def imports(tree: ast.AST) -> Iterator[str]:
    """Yield every imported module, `from a import b` as both `a` and `a.b`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    """Yield every call with its dotted name, such as `np.load` and `().read_text`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            words, function = list[str](), node.func
            while isinstance(function, ast.Attribute):
                words.append(function.attr)
                function = function.value
            words.append(function.id if isinstance(function, ast.Name) else "()")
            yield ".".join(reversed(words)), node


def faults(rule: Callable[[Path], Iterator[str]], files: list[Path]) -> list[str]:
    """Return the findings of a rule in files, with the file names."""
    return [f"{relative(path)}: {fault}" for path in files for fault in rule(path)]


def allowed(path: Path, module: str) -> bool:
    """Whether a file may import a module."""
    target = module.split(".")
    if target[0] not in {"pipeline", "stages", "eval", "tests"}:
        return True
    if target[0] == "tests":
        return False
    place = path.relative_to(ROOT).parts
    if place[0] == "eval":
        return True
    if place[0] == "pipeline":
        return target[0] == "pipeline"
    if target[0] == "pipeline" or len(target) == 1:
        return target[0] in {"pipeline", "stages"}
    return target[0] == "stages" and (place[1] != "shape" or target[1] == "shape")


def forbidden_imports(path: Path) -> Iterator[str]:
    yield from (f"may not import {item}" for item in imports(parsed(path)) if not allowed(path, item))


def test_imports_follow_the_data_flow() -> None:
    files = [path for path in CODE if path.parent != ROOT / "stages"]
    assert faults(forbidden_imports, files) == []


def test_rooms_do_not_import_in_a_circle() -> None:
    """Every folder may import those below it: the vocabulary is at the bottom; package is read where datasets are."""
    reads: dict[str, set[str]] = {}
    for path in CODE:
        place = path.relative_to(ROOT).parts
        if place[0] == "stages" and len(place) > 2:
            modules = [module.split(".") for module in imports(parsed(path))]
            targets = {module[1] for module in modules if module[0] == "stages" and len(module) > 1}
            reads.setdefault(place[1], set()).update(targets - {place[1]})
    order = list(TopologicalSorter(reads).static_order())
    assert order[0] == "shape"
    assert [room for room, read in reads.items() if "package" in read] == ["export", "publishing", "verification"]


def test_public_functions_and_classes_have_names_of_their_own() -> None:
    homes: dict[str, list[str]] = {}
    for path in CODE:
        if path in FRONT_DOORS or path.name in ("commands.py", "stage.py", "cli.py"):
            continue
        for node in parsed(path).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(relative(path))
    shared = {name: paths for name, paths in homes.items() if len(paths) > 1 and name not in HOOKS}
    assert shared == {}


def test_stages_are_found_without_numba_and_scipy() -> None:
    """A run with nothing to make answers in a second; run functions import kernels and native libraries inside."""
    program = "import sys; from pipeline.registry import find_stages; find_stages(); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert {"numba", "scipy", "trimesh", "torch", "pyarrow"}.isdisjoint(done.stdout.split())


def nondeterministic(path: Path) -> Iterator[str]:
    """Yield uses of clocks, of the machine or of global state."""
    tree = parsed(path)
    yield from {item for item in imports(tree) if item.split(".")[0] in {"random", "uuid", "secrets"}}
    for name, call in calls(tree):
        tail = name.split(".")
        if tail[-2:-1] == ["random"] and tail[0] in {"np", "numpy"} and tail[-1] not in GLOBAL_RANDOMNESS:
            yield f"line {call.lineno}: {name} draws from a global"
        if tail[-1] == "default_rng" and not (call.args or call.keywords):
            yield f"line {call.lineno}: an unseeded generator"
        if path.is_relative_to(ROOT / "stages") and ".".join(tail[-2:]) in CLOCKS:
            yield f"line {call.lineno}: {name} is a clock"


def test_bytes_depend_on_no_global_randomness_no_clock_no_uuid() -> None:
    assert faults(nondeterministic, CODE) == []


def unnamed_encodings(path: Path) -> Iterator[str]:
    for name, call in calls(parsed(path)):
        words = {keyword.arg for keyword in call.keywords}
        method = name.rpartition(".")[2]
        reads, writes = method == "read_text" and not call.args, method == "write_text" and len(call.args) == 1
        opens = name == "open" and (len(call.args) < 2 or "b" not in ast.unparse(call.args[1]))
        if (reads or writes or opens) and "encoding" not in words:
            yield f"line {call.lineno}: {method} without encoding depends on the locale"


def test_text_files_name_their_encoding() -> None:
    assert not faults(unnamed_encodings, ALL)


def test_stages_hold_only_files_that_fingerprints_cover() -> None:
    files = (path for path in (ROOT / "stages").rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    assert {path.suffix for path in files} <= {".py", ".md"}, "pipeline/code.py digests Python alone"


def executing(path: Path) -> Iterator[str]:
    """Yield code that would execute what it reads."""
    tree = parsed(path)
    yield from {item for item in imports(tree) if item.split(".")[0] in EXECUTING}
    for name, call in calls(tree):
        if name in {"yaml.load", "yaml.unsafe_load", "yaml.full_load", "eval", "exec"}:
            yield f"line {call.lineno}: {name}"
        required = REQUIRED_KEYWORDS.get(name)
        if required and required not in {f"{keyword.arg}={ast.unparse(keyword.value)}" for keyword in call.keywords}:
            yield f"line {call.lineno}: say {required}"


def test_nothing_executes_what_it_reads() -> None:
    assert faults(executing, CODE) == []


READERS = {
    "trimesh.load": (),
    "trimesh.load_scene": (),
    "trimesh.load_mesh": (),
    "np.loadtxt": ("stages/cloud_files/",),
    "np.genfromtxt": (),
    "o3d.io.read_point_cloud": ("stages/cloud_files/",),
    "o3d.io.read_triangle_mesh": (),
    "collada.Collada": ("stages/model_files/",),
    "Image.open": ("stages/model_files/", "stages/recovery/drawing_file.py"),
}
"""Calls that parse models, clouds and pictures, and the files that may make them."""


def parses_by_itself(path: Path) -> Iterator[str]:
    """Yield calls of parsers outside `read_model`, `read_cloud` and `read_drawing`; samples are in memory."""
    for name, call in calls(parsed(path)):
        if name not in READERS or relative(path).startswith(READERS[name] or ("-",)):
            continue
        if not call.args or not ast.unparse(call.args[0]).startswith("io.BytesIO("):
            yield f"line {call.lineno}: {name}"


def test_files_of_users_are_parsed_by_their_one_reader() -> None:
    assert faults(parses_by_itself, CODE) == []


def defaulted_streams(path: Path) -> Iterator[str]:
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            named = [*node.args.posonlyargs, *node.args.args]
            defaulted = named[len(named) - len(node.args.defaults) :]
            defaulted += [
                argument
                for argument, default in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
                if default is not None
            ]
            if "rng" in {argument.arg for argument in defaulted}:
                yield f"line {node.lineno}"


def test_random_streams_are_arguments_without_default() -> None:
    assert faults(defaulted_streams, CODE) == []


def kernels(tree: ast.Module) -> list[ast.FunctionDef]:
    """Return the functions that numba compiles."""
    return [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any(ast.unparse(item).startswith("numba.njit") for item in node.decorator_list)
    ]


def test_untyped_definitions_are_allowed_only_in_files_with_kernels() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    assert settings["strict"]
    exempt = [setting["module"] for setting in settings["overrides"] if setting.get("disallow_untyped_defs") is False]
    files = [path for path in CODE if kernels(parsed(path))]
    assert exempt == [[relative(path).removesuffix(".py").replace("/", ".") for path in files]]


def untyped(path: Path) -> Iterator[str]:
    """Yield the functions without all types, except kernels."""
    tree = parsed(path)
    compiled = kernels(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node not in compiled:
            named = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            without = [item.arg for item in named if item.annotation is None and item.arg not in {"self", "cls"}]
            if node.returns is None:
                yield f"line {node.lineno}: what does {node.name} return?"
            if without:
                yield f"line {node.lineno}: {node.name} has {', '.join(without)} without a type"


def test_every_function_but_kernels_is_typed() -> None:
    assert faults(untyped, CODE) == []


def misnamed(path: Path) -> Iterator[str]:
    """Yield what is wrong with the name and the first lines of a file."""
    names = {path.stem, *path.relative_to(ROOT).parts} & BANNED_NAMES
    if names:
        yield f"is called {', '.join(names)}"
    text = path.read_text(encoding="utf-8")
    if text and path in CODE and not ast.get_docstring(parsed(path)):
        yield "has no docstring"
    if "import " in text and "from __future__ import annotations" not in text:
        yield "lacks `from __future__ import annotations`"


def test_every_file_has_a_specific_name_and_a_docstring() -> None:
    assert faults(misnamed, ALL) == []


def test_every_stage_file_holds_the_stage_of_its_folder() -> None:
    from pipeline.registry import find_stages

    folders = {path.parent.name for path in (ROOT / "stages").glob("*/stage.py")}
    stages = find_stages()
    assert set(stages) == folders
    for index, stage in enumerate(stages.values()):
        assert set(stage.inputs) <= set(list(stages)[:index]), "a stage comes after the stages that it reads"


def test_every_config_key_has_a_description() -> None:
    from pipeline.config import DatasetFacts, StrictModel
    from pipeline.registry import find_stages

    models: list[type[StrictModel]] = [DatasetFacts, *(stage.config for stage in find_stages().values())]
    for model in models:
        schema = model.model_json_schema()
        for model_schema in [schema, *schema.get("$defs", {}).values()]:
            for key, field in model_schema.get("properties", {}).items():
                assert field.get("description") or "$ref" in field, f"{model_schema['title']}.{key} has no description"


def test_pages_of_config_keys_match_the_models() -> None:
    from pipeline.config_docs import outdated_pages
    from pipeline.registry import find_stages

    assert outdated_pages(ROOT / "configs/sections", find_stages()) == [], "run `make config-docs`"
