"""A server with the part of Hugging Face's HTTP interface that publishing uses: repositories, LFS and commits."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit


@dataclass
class State:
    """What the server has, and whether it fails.

    repositories: the bytes of each file by path, by the name of the repository
    blobs: large contents by sha256
    uploads: sha256 of each content that was sent
    commits: repository of each commit
    max_uploads: number of contents after which the server fails
    """

    repositories: dict[str, dict[str, bytes]] = field(default_factory=dict)
    blobs: dict[str, bytes] = field(default_factory=dict)
    uploads: list[str] = field(default_factory=list)
    commits: list[str] = field(default_factory=list)
    max_uploads: int = 1_000


def is_large(path: str) -> bool:
    return path.endswith((".tar", ".parquet"))


class HuggingFace(BaseHTTPRequestHandler):
    """Answers requests from `state`."""

    state: State
    protocol_version = "HTTP/1.1"

    def log_message(self, *_: Any) -> None:
        """Print nothing."""

    def do_GET(self) -> None:
        name, asked, place = self._repository(r"/(?:api/)?datasets/(\w+/[\w-]+)(/tree/main|/resolve/main|)/?(.*)")
        if name not in self.state.repositories:
            self._answer({"error": "Repository Not Found"}, 404, {"X-Error-Code": "RepoNotFound"})
            return
        files = self.state.repositories[name]
        if asked == "/resolve/main":
            self._send_range(files[place])
        elif asked:
            is_recursive = "recursive=true" in self.path.lower()
            self._answer([self._entry(name, path) for path in self._paths_in(name, place, is_recursive)])
        else:
            self._answer({"id": name, "sha": "0" * 40, "siblings": []})

    def do_PUT(self) -> None:
        digest, content = self.path.rpartition("/")[2], self._body()
        if len(self.state.uploads) >= self.state.max_uploads:
            self._answer({"error": "no"}, 403)
            return
        assert hashlib.sha256(content).hexdigest() == digest
        self.state.blobs[digest] = content
        self.state.uploads.append(digest)
        self._answer({})

    def do_POST(self) -> None:
        body = self._body()
        path = urlsplit(self.path).path
        if path == "/api/repos/create":
            asked = json.loads(body)
            assert asked["type"] == "dataset"
            name = f"{asked['organization']}/{asked['name']}"
            status = 409 if name in self.state.repositories else 200
            self.state.repositories.setdefault(name, {})
            self._answer({"url": f"{self._url}/datasets/{name}"}, status)
        elif path.endswith("/preupload/main"):
            files = [file["path"] for file in json.loads(body)["files"]]
            modes = {name: "lfs" if is_large(name) else "regular" for name in files}
            self._answer({"files": [{"path": p, "uploadMode": m, "shouldIgnore": False} for p, m in modes.items()]})
        elif path.endswith("/info/lfs/objects/batch"):
            self._answer({"transfer": "basic", "objects": [self._place(item) for item in json.loads(body)["objects"]]})
        elif path.endswith("/paths-info/main"):
            name = path.removeprefix("/api/datasets/").removesuffix("/paths-info/main")
            asked = parse_qs(body.decode())["paths"]
            known = self._paths_in(name, "", is_recursive=True)
            self._answer([self._entry(name, entry) for entry in asked if entry in known])
        elif path == "/api/validate-yaml":
            self._answer({"errors": [], "warnings": []})
        else:
            self._commit([json.loads(line) for line in body.splitlines()])

    def _place(self, item: dict[str, Any]) -> dict[str, Any]:
        if item["oid"] in self.state.blobs:
            return item
        return item | {"actions": {"upload": {"href": f"{self._url}/blobs/{item['oid']}"}}}

    def _commit(self, lines: list[dict[str, Any]]) -> None:
        (name,) = self._repository(r"/api/datasets/(.+)/commit/main")
        files = self.state.repositories[name]
        for line in lines:
            kind, value = line["key"], line["value"]
            if kind == "file":
                files[value["path"]] = base64.b64decode(value["content"])
            elif kind == "lfsFile":
                files[value["path"]] = self.state.blobs[value["oid"]]
            elif kind == "deletedFile":
                del files[value["path"]]
        self.state.commits.append(name)
        self._answer({"success": True, "commitOid": "0" * 40, "commitUrl": f"{self._url}/datasets/{name}/commit/0"})

    def _paths_in(self, name: str, folder: str, is_recursive: bool) -> list[str]:
        """The files and folders in a folder."""
        files = self.state.repositories[name]
        folders = {str(parent) for path in files for parent in PurePosixPath(path).parents} - {"."}
        inside = [path for path in [*files, *sorted(folders)] if not folder or path.startswith(f"{folder}/")]
        return [path for path in inside if is_recursive or path.rpartition("/")[0] == folder]

    def _send_range(self, content: bytes) -> None:
        first, _, last = self.headers.get("Range", "bytes=0-").removeprefix("bytes=").partition("-")
        asked = content[int(first) : int(last) + 1 if last else None]
        self.send_response(206 if "Range" in self.headers else 200)
        self.send_header("Content-Length", str(len(asked)))
        self.end_headers()
        self.wfile.write(asked)

    def _entry(self, name: str, path: str) -> dict[str, Any]:
        if path not in self.state.repositories[name]:
            return {"type": "directory", "path": path, "size": 0, "oid": "0" * 40}
        content = self.state.repositories[name][path]
        sha1 = hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest()
        entry = {"type": "file", "path": path, "size": len(content), "oid": sha1}
        large = {"oid": hashlib.sha256(content).hexdigest(), "size": len(content), "pointerSize": 130}
        return entry | ({"lfs": large} if is_large(path) else {})

    @property
    def _url(self) -> str:
        return f"http://{self.headers['Host']}"

    def _repository(self, pattern: str) -> tuple[str, ...]:
        match = re.fullmatch(pattern, unquote(urlsplit(self.path).path))
        assert match, self.path
        return match.groups()

    def _body(self) -> bytes:
        if "chunked" not in self.headers.get("Transfer-Encoding", ""):
            return self.rfile.read(int(self.headers["Content-Length"]))
        chunks = b""
        while size := int(self.rfile.readline(), 16):
            chunks += self.rfile.read(size)
            self.rfile.readline()
        self.rfile.readline()
        return chunks

    def _answer(self, value: Any, status: int = 200, headers: dict[str, str] | None = None) -> None:
        content = json.dumps(value).encode()
        self.send_response(status)
        for name, text in {"Content-Type": "application/json", **(headers or {})}.items():
            self.send_header(name, text)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)
