"""What set-up installs: wheels, so that no compiler is needed, and every shared library that they load."""

from __future__ import annotations

import mmap
import re
import struct
import tomllib
from collections.abc import Iterator
from importlib.metadata import Distribution, distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]

BASE = re.compile(r"(ld-linux-x86-64|libc|libdl|libgcc_s|libm|libpthread|libresolv|librt|libstdc\+\+|libz)\.so\.\d+")
"""What the C and C++ runtimes and apt itself bring to every Debian."""

NEVER_LOADED = {"open3d_torch_ops", "open3d_tf_ops", "omppool"}
"""Open3D's operators for other frameworks; numba's threads by OpenMP, which needs what no wheel brings."""

FOR_CARDS = ("cuda-", "nvidia-", "triton")
"""What torch needs besides where pip's source has its build for graphics cards."""


def lock_lines() -> list[str]:
    return [
        line
        for line in (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
        if not line.startswith("#")
    ]


def pinned() -> dict[str, str]:
    pairs = [line.split("==") for line in lock_lines() if not line.startswith("--")]
    return {canonicalize_name(name): version for name, version in pairs}


def built_here() -> list[str]:
    options = dict(line.split(" ", 1) for line in lock_lines() if line.startswith("--"))
    assert options["--only-binary"] == ":all:"
    return options["--no-binary"].split(",")


def elf_files(found: Distribution) -> Iterator[Path]:
    for file in found.files or ():
        path = Path(str(file.locate()))
        if path.suffix != ".py" and path.is_file():
            with open(path, "rb") as stream:
                if stream.read(4) == b"\x7fELF":
                    yield path


def dynamic_names(path: Path) -> tuple[set[str], set[str]]:
    """The names under which an x86-64 ELF file is known, and the libraries that it needs (ELF specification, chapter
    on dynamic linking)."""
    with open(path, "rb") as stream:
        content = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    table, size, count = *struct.unpack_from("<Q", content, 32), *struct.unpack_from("<HH", content, 54)
    headers = [struct.unpack_from("<IIQQQQQQ", content, table + size * index) for index in range(count)]
    known, needed = {path.name}, set()
    for _, _, start, _, _, length, *_ in (header for header in headers if header[0] == 2):
        entries = [struct.unpack_from("<QQ", content, start + 16 * index) for index in range(length // 16)]
        address = dict(entries)[5]
        segment = next(header for header in headers if header[0] == 1 and header[3] <= address < header[3] + header[5])
        names = segment[2] + address - segment[3]
        for tag, value in entries:
            text = content[names + value : content.find(b"\0", names + value)].decode() if tag in (1, 14) else ""
            if tag == 1:
                needed.add(text)
            elif tag == 14:
                known.add(text)
    return known, needed


def test_pinned_packages_are_those_that_the_code_needs() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    asked = [Requirement(item) for item in (*project["dependencies"], *(item for extra in extras for item in extra))]
    versions, reached = pinned(), set()
    while asked:
        requirement = asked.pop()
        name = canonicalize_name(requirement.name)
        assert name in versions, f"{requirement} is not in requirements.lock: run `make lock`"
        found = distribution(name)
        assert found.version.partition("+")[0] == versions[name]
        assert requirement.specifier.contains(found.version), f"{requirement}, and {found.version} is installed"
        for extra in {"", *requirement.extras} - {item for known, item in reached if known == name}:
            reached.add((name, extra))
            wanted = [Requirement(item) for item in found.requires or ()]
            wanted = [item for item in wanted if item.marker is None or item.marker.evaluate({"extra": extra})]
            asked += [item for item in wanted if not item.name.startswith(FOR_CARDS)]
    assert {name for name, _ in reached} == set(versions), "requirements.lock pins what nothing asks for"


def test_pinned_packages_install_without_a_compiler() -> None:
    for name in built_here():
        assert not list(elf_files(distribution(name))), f"{name} has no wheel and is not plain Python"


def test_every_shared_library_comes_with_a_wheel_or_is_installed_by_set_up() -> None:
    table = (ROOT / "pipeline/libraries.txt").read_text(encoding="utf-8").splitlines()
    installed = {line.split()[0] for line in table if not line.startswith("#")}
    versions, brought, needs = pinned(), set(), {}
    for found in distributions():
        if canonicalize_name(found.name) in versions:
            for path in elf_files(found):
                known, needed = dynamic_names(path)
                brought |= known
                if path.name.partition(".")[0] not in NEVER_LOADED:
                    needs |= dict.fromkeys(needed, path)
    missing = {name: path for name, path in needs.items() if not (name in brought | installed or BASE.fullmatch(name))}
    assert not missing, "name the Debian packages of these in pipeline/libraries.txt"
    assert len(brought) > 500
