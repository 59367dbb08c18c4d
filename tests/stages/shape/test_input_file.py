"""Files are told by their first bytes, before any parser sees them."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import os
import tarfile
import zipfile
from pathlib import Path

import pytest

from pipeline.errors import ConfigError
from stages.shape.input_file import check_first_bytes, check_input_file, decode_text, without_sidecars

CASES = Path(__file__).resolve().parents[3].parent / "shared" / "cases"
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"0" * 64 + b"\nsize 123456\n"


def zipped() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("model.obj", "v 0 0 0")
    return stream.getvalue()


def tarred() -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        archive.addfile(tarfile.TarInfo("model.obj"))
    return stream.getvalue()


REFUSED = {
    "pointer": (POINTER, r"a Git LFS pointer to 123,456 bytes, .*`git lfs pull`"),
    "old pointer": (POINTER.replace(b"git-lfs.github.com", b"hawser.github.com"), "Git LFS pointer"),
    "pointer without a size": (POINTER[:60], "Git LFS pointer, not"),
    "pointer with CRLF": (POINTER.replace(b"\n", b"\r\n"), "Git LFS pointer to 123,456 bytes"),
    "annex": (b"/annex/objects/SHA256E-s12--00.glb\n", "git annex get"),
    "page": (b"\n<!DOCTYPE html>\n<html>", "a web page"),
    "page with a mark": (b"\xef\xbb\xbf<HTML lang='en'>", "a web page"),
    "saved page": (b"<!-- saved from url=(0014)about:internet -->\n<html>", "a web page"),
    "XHTML": (b'<?xml version="1.0"?>\n<!DOCTYPE html PUBLIC "-//W3C">', "a web page"),
    "server": (b'<?xml version="1.0"?>\n<Error><Code>AccessDenied</Code>', "message of a server"),
    "gzip": (gzip.compress(b"v 0 0 0"), r"packed \(gzip\); unpack it \(`gunzip FILE`\)"),
    "zip": (zipped(), r"packed \(zip\)"),
    "bzip2": (bz2.compress(b"v 0 0 0"), r"packed \(bzip2\)"),
    "xz": (lzma.compress(b"v 0 0 0"), r"packed \(xz\)"),
    "tar": (tarred(), "tar archive"),
    "sidecar": (b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X", r"without `\._`"),
    "zero": (bytes(5000), "zero bytes only"),
    "empty": (b"", "the file is empty"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_content_that_no_reader_knows_is_named(name: str, tmp_path: Path) -> None:
    content, words = REFUSED[name]
    path = tmp_path / "model.glb"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=words) as caught:
        check_input_file(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        b"glTF\x02\0\0\0",
        b"# version https://git-lfs.github.com\nv 0 0 0\n",
        b'<?xml version="1.0"?><COLLADA>',
        b"ply\n",
        b"\x1f 1 2\n",
        b"BZhang 80 byte header",
        b"v 0 0 0 # <html>\n",
        b"<!-- made by hand -->\n<COLLADA>",
    ],
)
def test_models_pass(content: bytes, tmp_path: Path) -> None:
    check_first_bytes("a model", content)


def test_format_that_is_an_archive_passes() -> None:
    check_first_bytes("arrays.npz", zipped(), packed="zip")
    with pytest.raises(ConfigError, match="gzip"):
        check_first_bytes("arrays.npz", gzip.compress(b""), packed="zip")


def test_names_that_are_no_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "chair.glb").mkdir()
    with pytest.raises(ConfigError, match="is a folder"):
        check_input_file(tmp_path / "chair.glb")
    with pytest.raises(ConfigError, match=r"did you mean chair\.glb\?"):
        check_input_file(tmp_path / "chiar.glb")
    os.mkfifo(tmp_path / "pipe.glb")
    with pytest.raises(ConfigError, match="no regular file"):
        check_input_file(tmp_path / "pipe.glb")


def test_sidecars_of_macos_are_counted(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("._a.glb", "a.glb", ".b.glb")]
    assert without_sidecars(files) == (files[1:], 1)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_text_is_decoded_in_any_unicode_encoding(encoding: str) -> None:
    assert decode_text("x;y;z\n1,5;2;3\n".encode(encoding)) == "x;y;z\n1,5;2;3\n"


@pytest.mark.parametrize("text", ["Höhe", "x", ""])
def test_short_text_and_accents_stay(text: str) -> None:
    assert decode_text(text.encode()) == text
    assert decode_text(b"H\xf6he") == "H\ufffdhe"


@pytest.mark.skipif(not CASES.is_dir(), reason="needs the shared material")
@pytest.mark.parametrize("name", ["lfs-pointer.glb", "lfs-pointer.ply"])
def test_pointers_of_the_cases_are_named(name: str) -> None:
    with pytest.raises(ConfigError, match="git lfs pull"):
        check_input_file(CASES / name)
