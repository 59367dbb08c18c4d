"""Validate GLB files with the Khronos glTF validator, a package of Node.js that is installed elsewhere.

npm install --prefix FOLDER gltf-validator
python -m tests.gltf_validity --validator FOLDER PATH...
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

FILES_A_CALL = 256
SEVERITIES = ("error", "warning", "info", "hint")
_SCRIPT = """
const fs = require('fs'), path = require('path'), validator = require('gltf-validator');
const folder = process.argv[1];
(async () => {
  for (const name of fs.readdirSync(folder).sort()) {
    const content = new Uint8Array(fs.readFileSync(path.join(folder, name)));
    const report = await validator.validateBytes(content, {format: 'glb', maxIssues: 0});
    console.log(JSON.stringify([Number(name), report.issues.messages]));
  }
})();
"""


def main() -> int:
    """Print each kind of message with its count and first place; 1 after an error or warning."""
    parser = argparse.ArgumentParser(prog="python -m tests.gltf_validity", description="Validate GLB files.")
    parser.add_argument("paths", type=Path, nargs="+", help="GLB files, and folders with GLB files or datasets")
    parser.add_argument("--validator", type=Path, required=True, help="folder that npm installed gltf-validator in")
    arguments = parser.parse_args()
    modules = arguments.validator / "node_modules"
    if shutil.which("node") is None or not (modules / "gltf-validator").is_dir():
        parser.error(f"needs node, and: npm install --prefix {arguments.validator} gltf-validator")
    files, counts, first = 0, Counter[tuple[int, str]](), dict[tuple[int, str], str]()
    for name, messages in _validated(_glb_files(arguments.paths), modules):
        files += 1
        for message in messages:
            kind = (message["severity"], message["code"])
            counts[kind] += 1
            first.setdefault(kind, f"{name} {message.get('pointer', '')}: {message['message']}")
    for (severity, code), count in sorted(counts.items()):
        print(f"{SEVERITIES[severity]} {code}: {count}, first in {first[severity, code]}")
    errors, warnings = (sum(n for kind, n in counts.items() if kind[0] == severity) for severity in (0, 1))
    print(f"{files} GLB files: {errors} errors, {warnings} warnings")
    return int(not files or errors + warnings > 0)


def _glb_files(paths: list[Path]) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of each GLB: files, those below folders, and members of shards below folders."""
    for path in paths:
        for file in [path] if path.is_file() else sorted(path.rglob("*")):
            if file.suffix == ".glb":
                yield str(file), file.read_bytes()
            elif file.suffix == ".tar":
                with tarfile.open(file) as shard:
                    for member in shard:
                        content = shard.extractfile(member) if member.name.endswith(".glb") else None
                        if content is not None:
                            yield f"{file}:{member.name}", content.read()


def _validated(files: Iterator[tuple[str, bytes]], modules: Path) -> Iterator[tuple[str, list[dict[str, object]]]]:
    """Yield the name of each file and the validator's messages."""
    while batch := list(islice(files, FILES_A_CALL)):
        with tempfile.TemporaryDirectory() as folder:
            for number, (_, content) in enumerate(batch):
                (Path(folder) / f"{number:04}").write_bytes(content)
            command = ["node", "-e", _SCRIPT, folder]
            environment = os.environ | {"NODE_PATH": str(modules.resolve())}
            done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        for line in done.stdout.splitlines():
            number, messages = json.loads(line)
            yield batch[number][0], messages


if __name__ == "__main__":
    sys.exit(main())
