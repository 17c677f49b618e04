# SPDX-License-Identifier: GPL-3.0-or-later
"""Extension zips from published wheels: those of an index or a folder, unmodified, with checked hashes."""

from __future__ import annotations

import functools
import hashlib
import http.server
import shutil
import subprocess
import sys
import tarfile
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path

import package
import published
import pytest
import targets
import wheel
from one_line import told

from addon.core.base import native

METADATA = f"Metadata-Version: 2.4\nName: halfspace-native\nVersion: {native.VERSION}\n"

DESCRIBED = f"halfspace_native-{native.VERSION}.dist-info"


def file_name(system: str, version: str = native.VERSION) -> str:
    return f"halfspace_native-{version}-cp311-abi3-{published.TAGS[system]}.whl"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a wheel of each system, each with its own content, and one of another version."""
    place = tmp_path / "simple" / "halfspace-native"
    place.mkdir(parents=True)
    for name in [*map(file_name, targets.TARGETS), file_name("linux-x64", "0.0.9")]:
        with zipfile.ZipFile(place / name, "w") as archive:
            archive.writestr("halfspace_native/__init__.py", f"# {name}\n")
            archive.writestr(f"{DESCRIBED}/METADATA", METADATA)
            archive.writestr(f"{DESCRIBED}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: false\n")
            archive.writestr(f"{DESCRIBED}/RECORD", "")
    return place


@pytest.fixture
def index(folder: Path) -> Iterator[str]:
    """The address of a package index on this machine that serves the folder."""
    kept = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder.parents[1]))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), kept) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/simple"
        server.shutdown()
        thread.join()


def bundled(zip_file: Path) -> dict[str, bytes]:
    """The wheels of a zip: bytes by file name."""
    with zipfile.ZipFile(zip_file) as archive:
        names = [name for name in archive.namelist() if name.endswith(".whl")]
        return {name.removeprefix("wheels/"): archive.read(name) for name in names}


def hashes(folder: Path, *systems: str) -> list[str]:
    """The options that give the hashes of the wheels of these systems."""
    found = [hashlib.sha256((folder / file_name(one)).read_bytes()).hexdigest() for one in systems]
    return [word for one in found for word in ("--sha256", one)]


def test_a_zip_holds_the_bytes_of_the_folder(folder: Path, tmp_path: Path) -> None:
    words = ["--index", str(folder), "--for", "all", *hashes(folder, *targets.TARGETS)]
    assert package.main([*words, "--out", str(tmp_path / "out")]) == 0
    found = bundled(tmp_path / "out" / f"halfspace-{native.VERSION}.zip")
    assert found == {name: (folder / name).read_bytes() for name in map(file_name, targets.TARGETS)}


def test_a_zip_holds_the_bytes_of_the_index(index: str, folder: Path, tmp_path: Path) -> None:
    words = ["--index", index, "--for", "windows-x64", *hashes(folder, "windows-x64")]
    assert package.main([*words, "--out", str(tmp_path / "out")]) == 0
    name = file_name("windows-x64")
    assert bundled(tmp_path / "out" / f"halfspace-{native.VERSION}.zip") == {name: (folder / name).read_bytes()}


def test_without_a_system_it_is_this_one(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(targets, "here", lambda: "macos-arm64")
    assert package.main(["--index", str(folder), "--out", str(tmp_path / "out")]) == 0
    assert [*bundled(tmp_path / "out" / f"halfspace-{native.VERSION}.zip")] == [file_name("macos-arm64")]


def test_a_wheel_that_was_changed_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = hashes(folder, "linux-arm64")
    changed = folder / file_name("linux-arm64")
    with changed.open("ab") as file:
        file.write(b"\0")
    for words in (["--index", str(folder), "--for", "linux-arm64"], ["--wheel", str(changed)]):
        said = told(package, [*words, *given, "--out", str(tmp_path / "out")], capsys)
        assert said.startswith(f"package: {changed.name}: its SHA-256 is ")
        assert not (tmp_path / "out").exists()


def test_every_wheel_needs_its_hash_and_every_hash_its_wheel(folder: Path) -> None:
    one, other = (folder / file_name(system) for system in ("linux-x64", "windows-x64"))
    (_, first, _, second) = hashes(folder, "linux-x64", "windows-x64")
    published.check([one, other], [second.upper(), first])
    with pytest.raises(published.PublishedError, match=f"^{other.name}: its SHA-256 is {second}, which is none"):
        published.check([one, other], [first])
    with pytest.raises(published.PublishedError, match=f"^no wheel has the SHA-256 {second}"):
        published.check([one], [first, second])
    with pytest.raises(published.PublishedError, match="'abc' is not a SHA-256"):
        published.check([one], ["abc"])


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--index", "EMPTY"], "package: EMPTY: no wheel of halfspace-native 0.1.0 for linux-x64: "),
        (["--index", "EMPTY", "--portable"], "package: --portable builds a wheel, --index takes one"),
    ],
)
def test_what_cannot_be_taken_is_one_line(
    words: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(targets, "here", lambda: "linux-x64")
    given = [word.replace("EMPTY", str(tmp_path)) for word in words]
    said = told(package, [*given, "--out", str(tmp_path / "out")], capsys)
    assert said.startswith(line.replace("EMPTY", str(tmp_path)))


def test_a_system_without_wheels_is_named(tmp_path: Path) -> None:
    with pytest.raises(published.PublishedError, match=r"^no wheel is published for macos-x64, only for "):
        published.take(str(tmp_path), native.VERSION, "macos-x64", tmp_path)


def test_every_system_has_a_tag_that_blender_knows() -> None:
    assert {name: package.platform_of(file_name(name)) for name in published.TAGS} == {n: n for n in targets.TARGETS}


@pytest.mark.skipif(shutil.which("cargo") is None, reason="Rust is not installed")
def test_the_source_archive_holds_what_the_wheel_is_made_from(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "maturin", "sdist", "--out", str(tmp_path)]
    done = subprocess.run(words, cwd=package.ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with tarfile.open(tmp_path / f"halfspace_native-{native.VERSION}.tar.gz") as archive:
        files = [one for one in archive.getmembers() if one.isfile()]
        held = {one.name.partition("/")[2]: archive.extractfile(one).read() for one in files}  # type: ignore[union-attr]
    # The crate for Rust programs, native/src, is not part of the module.
    crates = [path.parent for path in (package.ROOT / "native").glob("*/Cargo.toml") if path.parent.name != "fuzz"]
    wanted = [path for path in wheel.sources(package.ROOT) if path.suffix in (".rs", ".pyi")]
    wanted = [path for path in wanted if any(path.is_relative_to(crate) for crate in crates)]
    wanted += [package.ROOT / name for name in (".cargo/config.toml", "LICENSE", "pyproject.toml", "native/Cargo.lock")]
    assert len(wanted) > 500
    for path in wanted:
        name = path.relative_to(package.ROOT).as_posix()
        assert name in held, name
        assert path.suffix in (".toml", ".lock") or held[name] == path.read_bytes(), name
    assert b"sse4.2" in held[".cargo/config.toml"]
    assert not [name for name, content in held.items() if str(package.ROOT).encode() in content]
