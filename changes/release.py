"""Make a release: join the changelog fragments, set the version, commit and tag.

`python changes/release.py 0.2.0`, from the root of the repository; `--check` only checks the fragments.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADINGS = {
    "data-format": "Data format",
    "added": "Added",
    "changed": "Changed",
    "fixed": "Fixed",
    "removed": "Removed",
}
MAX_LINE_CHARACTERS = 120


def read_fragments(folder: Path) -> dict[str, list[str]]:
    """Return the lines of all fragments by kind, in the order of their files.

    Raises ValueError for a file whose name or line breaks the rules of `changes/README.md`.
    """
    lines: dict[str, list[str]] = {kind: [] for kind in HEADINGS}
    for path in sorted(folder.glob("*.md")):
        if path.name == "README.md":
            continue
        parts = path.name.split(".")
        if len(parts) != 3 or parts[1] not in HEADINGS:
            raise ValueError(f"{path.name}: name it <topic>.<kind>.md with a kind of {', '.join(HEADINGS)}")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if not line or line.startswith(("-", "*", "#")) or len(line) > MAX_LINE_CHARACTERS:
                rule = f"one sentence a line, no bullet, at most {MAX_LINE_CHARACTERS} characters"
                raise ValueError(f"{path.name}, line {number}: {rule}")
            lines[parts[1]].append(line)
    return lines


def release_section(version: str, date: str, lines: dict[str, list[str]]) -> str:
    """Return the changelog's section of a release."""
    blocks = [f"## {version} ({date})"]
    blocks.append("Data format: " + " ".join(lines["data-format"] or ["unchanged."]))
    for kind, heading in HEADINGS.items():
        if kind != "data-format" and lines[kind]:
            blocks.append(f"### {heading}\n\n" + "\n".join(f"- {line}" for line in lines[kind]))
    return "\n\n".join(blocks) + "\n"


def join(changelog: str, section: str, date: str) -> str:
    """Return the changelog with a new section on top; the first release takes the date instead."""
    version = section.split()[1]
    if f"## {version} (unreleased)" in changelog:
        return changelog.replace(f"## {version} (unreleased)", f"## {version} ({date})", 1)
    if f"## {version} " in changelog:
        raise ValueError(f"CHANGELOG.md already has a section {version}")
    first = changelog.index("\n## ") + 1
    return changelog[:first] + section + "\n" + changelog[first:]


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def main(arguments: list[str]) -> int:
    """Check the fragments, or make the release of a version."""
    try:
        lines = read_fragments(ROOT / "changes")
        if arguments == ["--check"]:
            return 0
        if len(arguments) != 1 or not re.fullmatch(r"\d+\.\d+\.\d+", arguments[0]):
            raise ValueError("name a version, such as `make release VERSION=0.2.0`")
        version = arguments[0]
        if _git("status", "--porcelain"):
            raise ValueError("the working tree has changes that are not committed")
        if _git("tag", "--list", f"v{version}"):
            raise ValueError(f"the tag v{version} exists")
        date = _git("log", "-1", "--format=%cs")
        changelog = ROOT / "CHANGELOG.md"
        text = join(changelog.read_text(encoding="utf-8"), release_section(version, date, lines), date)
        changelog.write_text(text, encoding="utf-8")
    except ValueError as error:
        print(f"no release: {error}", file=sys.stderr)
        return 2
    project = ROOT / "pyproject.toml"
    stated = re.sub(r'(?m)^version = "[^"]+"$', f'version = "{version}"', project.read_text(encoding="utf-8"), count=1)
    project.write_text(stated, encoding="utf-8")
    for path in (ROOT / "changes").glob("*.*.md"):
        path.unlink()
    _git("add", "-A")
    _git("commit", "-m", f"Release {version}")
    _git("tag", "-a", f"v{version}", "-m", f"Shapemill {version}")
    print(f"tagged v{version}; push with: git push --follow-tags")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
