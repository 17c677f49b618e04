# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheel and the extension's package: when it is built, what goes into it, where it runs."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import grimp
import pytest

from addon.core.base import native
from scripts import package, package_python
from scripts.dev import environment
from scripts.systems import targets
from tests.one_line import told


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The least that a fingerprint is made from."""
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    (tmp_path / "native" / "src").mkdir(parents=True)
    (tmp_path / "native" / "tests").mkdir()
    (tmp_path / "native" / "src" / "lib.rs").write_text("one")
    (tmp_path / "native" / "tests" / "contract.rs").write_text("one")
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "1"\n[tool.ruff]\nline-length = 1\n')
    return tmp_path


@pytest.mark.parametrize(
    ("name", "content", "same"),
    [
        ("native/src/lib.rs", "two", False),
        ("native/src/new.rs", "one", False),
        ("pyproject.toml", '[project]\nversion = "2"\n', False),
        ("LICENSE", "words", False),
        ("pyproject.toml", '[project]\nversion = "1"\n[tool.ruff]\nline-length = 2\n', True),
        ("native/tests/contract.rs", "two", True),
        ("native/target/x.rs", "build output", True),
    ],
)
def test_the_wheel_is_built_again_only_for_what_is_in_it(project: Path, name: str, content: str, same: bool) -> None:
    before = environment.fingerprint()
    path = project / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)
    assert (environment.fingerprint() == before) is same


def unreached(graph: grimp.ImportGraph) -> set[str]:
    """The modules that `addon` never loads: by an import, by one below it, or by their path as a text of a module."""
    folder = environment.ROOT / "addon"
    for path in folder.rglob("*.py"):
        for word in re.findall(r'"(\w+)\.py"', path.read_text(encoding="utf-8")):
            if (named := path.with_name(f"{word}.py")).is_file():
                names = [".".join(one.relative_to(folder.parent).with_suffix("").parts) for one in (path, named)]
                graph.add_import(importer=names[0], imported=names[1])
    loaded = graph.find_upstream_modules("addon") | {"addon"}
    return {one for one in graph.modules if not any(f"{name}.".startswith(f"{one}.") for name in loaded)}


def test_everything_that_is_packaged_is_reached_by_the_extension(tmp_path: Path) -> None:
    graph = grimp.build_graph("addon", exclude_type_checking_imports=True, cache_dir=None)
    assert {one for one in unreached(graph) if not one.startswith("addon.lab")} == set()
    # The check can fail: a module without importers, and one that loses its only importer.
    graph.add_module("addon.core.measure.orphan")
    graph.remove_import(importer="addon.blender.read.sky", imported="addon.blender.read.sky_bake")
    loaded = graph.find_upstream_modules("addon")
    assert "addon.core.measure.orphan" in unreached(graph)
    assert "addon.blender.read.sky_bake" not in loaded
    package.stage([], tmp_path / "staged")
    beside = {path.name for path in (tmp_path / "staged").rglob("*") if path.is_file() and path.suffix != ".py"}
    pages = {"page.html", "inspector.html", "inspector.js"}
    assert beside == {"LICENSE", "blender_manifest.toml", "manual.md", *pages}
    assert not (tmp_path / "staged" / "lab").exists()


def test_the_package_imports_itself_relatively() -> None:
    # Extension and wheel have the package under other names.
    absolute = re.compile(r"^\s*(from|import) addon\b", re.MULTILINE)
    paths = sorted((environment.ROOT / "addon").rglob("*.py"))
    assert [path for path in paths if absolute.search(path.read_text(encoding="utf-8"))] == []
    assert absolute.search("def late():\n    from addon.core import base\n")


MANIFEST = 'id = "x"\nversion = "1.2.3"\n\n[permissions]\nfiles = "Because"\n'


def test_the_manifest_gets_its_wheels_before_the_first_table() -> None:
    import tomllib

    names = ["x_native-1.2.3-cp311-abi3-win_amd64.whl", "x_native-1.2.3-cp311-abi3-manylinux_2_28_x86_64.whl"]
    filled = tomllib.loads(package.filled_manifest(MANIFEST, names))
    assert filled["wheels"] == sorted(f"./wheels/{name}" for name in names)
    assert filled["platforms"] == ["linux-x64", "windows-x64"]
    assert filled["permissions"] == {"files": "Because"}


def test_the_manifest_gets_the_page_of_its_publisher() -> None:
    import tomllib

    filled = tomllib.loads(package.filled_manifest(MANIFEST, [], "https://example.org/halfspace"))
    assert filled["website"] == "https://example.org/halfspace"
    assert "website" not in tomllib.loads(package.filled_manifest(MANIFEST, []))


@pytest.mark.parametrize("page", ["", "example.org", "ftp://example.org", 'https://a"b', "https://a b"])
@pytest.mark.parametrize("program", [package, package_python], ids=["package", "package_python"])
def test_a_page_that_is_none_is_refused(program: Any, page: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert "is not the address of a page" in told(program, ["--website", page], capsys)


def test_a_wheel_of_another_version_is_refused() -> None:
    with pytest.raises(package.PackageError, match=r"its version is not 1\.2\.3"):
        package.filled_manifest(MANIFEST, ["x_native-1.2.4-cp311-abi3-win_amd64.whl"])
    with pytest.raises(package.PackageError, match="knows no platform"):
        package.filled_manifest(MANIFEST, ["x_native-1.2.3-cp311-abi3-emscripten_wasm32.whl"])
    with pytest.raises(package.PackageError, match="wheels is filled in here"):
        package.filled_manifest('version = "1.2.3"\nwheels = []\n', [])


@pytest.mark.parametrize(
    ("tag", "platform"),
    [
        ("manylinux_2_17_x86_64.manylinux2014_x86_64", "linux-x64"),
        ("linux_x86_64", "linux-x64"),
        ("macosx_11_0_arm64", "macos-arm64"),
        ("win_arm64", "windows-arm64"),
    ],
)
def test_platform_tags_are_translated(tag: str, platform: str) -> None:
    assert package.platform_of(f"x-1-cp311-abi3-{tag}.whl") == platform


def wheel_with(path: Path) -> Path:
    """A wheel without metadata."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("x/x.abi3.so", b"\x7fELF")
    return path


@pytest.mark.parametrize(
    ("tag", "needed"),
    [
        ("manylinux_2_17_x86_64.manylinux2014_x86_64", ""),
        ("manylinux_2_28_x86_64", ""),
        ("manylinux_2_35_x86_64", "2.35"),
        ("win_amd64", ""),
    ],
)
def test_a_wheel_for_newer_systems_than_blender_s_is_told_when_it_is_packaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tag: str, needed: str
) -> None:
    path = wheel_with(tmp_path / f"x-1-cp311-abi3-{tag}.whl")
    monkeypatch.setattr(package, "stage", lambda *_, **__: None)
    monkeypatch.setattr(package, "run_tool", lambda *words: Path(words[-1]).touch() if words[0] == "build" else None)
    assert package.main(["--wheel", str(path), "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().err
    warning = f"package: WARNING: {path.name} needs glibc {needed} or newer, Blender only 2.28: "
    assert said.startswith(warning) if needed else not said


NAME = "x-1-cp311-abi3-manylinux_2_28_x86_64.whl"


def test_a_wheel_is_kept_with_its_fingerprint_beside_others(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[list[str], dict[str, str]]] = []

    def run(command: list[str], **named: Any) -> subprocess.CompletedProcess[str]:
        seen.append((command, named["env"]))
        out = Path(command[command.index("--out") + 1])
        out.mkdir(parents=True)
        wheel_with(out / NAME)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(environment.subprocess, "run", run)
    monkeypatch.setattr(environment.shutil, "which", lambda name: name)
    python = Path("/env/bin/python")
    other = ("wheel-linux-x64", ["--zig"], {"NAME": "value"})
    for built in (True, False):
        assert environment.build_wheel(python) == (project / "build" / "wheel" / NAME, built)
        assert environment.build_wheel(python, *other) == (project / "build" / "wheel-linux-x64" / NAME, built)
    assert [words[-1] for words, _ in seen] == [str(python), "--zig"]
    assert (seen[1][1]["NAME"], seen[1][1]["PYO3_PYTHON"]) == ("value", str(python))
    # A failed build leaves the old wheel.
    (project / "LICENSE").write_text("changed", encoding="utf-8")
    monkeypatch.setattr(environment.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 1))
    with pytest.raises(environment.SetupError, match="does not build"):
        environment.build_wheel(python)
    assert (project / "build" / "wheel" / NAME).is_file()


@pytest.mark.parametrize(
    ("system", "portable", "prepared"), [("linux", True, True), ("linux", False, False), ("darwin", True, False)]
)
def test_bundles_built_wheels_next_to_given_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, system: str, portable: bool, prepared: bool
) -> None:
    ready: list[environment.Environment] = []
    asked: list[Any] = []
    bundled: list[str] = []

    def build(_: Path, *options: Any) -> tuple[Path, bool]:
        asked.append(options)
        return wheel_with(tmp_path / NAME), True

    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "prepare", ready.append)
    monkeypatch.setattr(environment, "build_wheel", build)
    monkeypatch.setattr(targets, "maturin", lambda target, _: (["--zig"], {}))
    monkeypatch.setattr(package, "stage", lambda wheels, *_, **__: bundled.extend(path.name for path in wheels))
    monkeypatch.setattr(package, "run_tool", lambda *words: Path(words[-1]).touch() if words[0] == "build" else None)
    given = wheel_with(tmp_path / "x-1-cp311-abi3-win_amd64.whl")
    arguments = ["--portable", "--wheel", str(given)] if portable else []
    assert package.main([*arguments, "--out", str(tmp_path)]) == 0
    assert asked == [(f"wheel-{targets.here()}", ["--zig"], {}) if prepared else ()]
    assert ready == [environment.PORTABLE] * prepared
    assert bundled == [given.name] * portable + [NAME]


@pytest.mark.parametrize("given", [["--for", "windows-x64", "--for", "linux-x64"], ["--for", "all"], ["--wheel", "."]])
def test_each_system_gets_a_zip_of_its_own_next_to_the_one_for_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    tags = {"linux-x64": "manylinux_2_28_x86_64", "linux-arm64": "manylinux_2_28_aarch64", "windows-x64": "win_amd64"}
    tags |= {"windows-arm64": "win_arm64", "macos-arm64": "macosx_11_0_arm64", "macos-x64": "macosx_10_12_x86_64"}
    assert set(tags) == set(targets.TARGETS)
    monkeypatch.chdir(tmp_path)
    systems = list(tags) if given[1] in ("all", ".") else given[1::2]
    files = {name: f"halfspace_native-0.1.0-cp311-abi3-{tags[name]}.whl" for name in systems}
    packed: list[list[str]] = []
    if given[1] == ".":
        for file in files.values():
            wheel_with(tmp_path / file)
    monkeypatch.setattr(package, "portable_wheel", lambda name: wheel_with(tmp_path / files[name]))
    page = ["--website", "https://example.org/halfspace"]
    assert package.main([*given, "--split", *page, "--out", str(tmp_path / "out")]) == 0
    names = ["halfspace-0.1.0.zip", *sorted(f"halfspace-0.1.0-{name.replace('-', '_')}.zip" for name in systems)]
    assert [Path(line.split(" (")[0]).name for line in capsys.readouterr().out.splitlines()] == names
    for name in systems:
        with zipfile.ZipFile(tmp_path / "out" / f"halfspace-0.1.0-{name.replace('-', '_')}.zip") as archive:
            packed.append([one for one in archive.namelist() if one.endswith(".whl")])
            assert f'website = "{page[1]}"' in archive.read("blender_manifest.toml").decode()
    with zipfile.ZipFile(tmp_path / "out" / names[0]) as archive:
        inside = [one for one in archive.namelist() if one.endswith(".whl")]
    # All zips hold the same build: one name of the module, for each system.
    (build,) = {one.removeprefix("wheels/halfspace_native_").partition("-")[0] for one in inside}
    renamed = {name: f"wheels/{file.replace('-', f'_{build}-', 1)}" for name, file in files.items()}
    assert sorted(inside) == sorted(renamed.values())
    assert packed == [[renamed[name]] for name in systems]


def test_unmodified_wheels_keep_their_bytes(tmp_path: Path) -> None:
    path = wheel_with(tmp_path / f"halfspace_native-{native.VERSION}-cp311-abi3-win_amd64.whl")
    assert package.main(["--wheel", str(path), "--unmodified", "--out", str(tmp_path / "out")]) == 0
    with zipfile.ZipFile(tmp_path / "out" / f"halfspace-{native.VERSION}.zip") as archive:
        assert archive.read(f"wheels/{path.name}") == path.read_bytes()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--wheel", "HERE"], "the folders hold no wheels"),
        (["--wheel", "HERE/x-1-cp311-abi3-linux_x86_64.whl"], "there is no such wheel"),
        (["--wheel", "HERE/broken"], "there is no such wheel"),
        (["--portable"], "pip failed in .venv-portable"),
    ],
)
def test_rejects_what_cannot_be_packaged_in_one_line(
    words: list[str], line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_: environment.Environment) -> None:
        raise environment.SetupError("pip failed in .venv-portable")

    (tmp_path / "broken").write_bytes(b"no wheel")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "prepare", fail)
    given = [word.replace("HERE", str(tmp_path)) for word in words]
    said = told(package, [*given, "--out", str(tmp_path)], capsys)
    assert said.startswith("package: ")
    assert said.endswith(f"{line}\n")


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
    wanted = [path for path in environment.sources() if path.suffix in (".rs", ".pyi")]
    wanted = [path for path in wanted if any(path.is_relative_to(crate) for crate in crates)]
    wanted += [package.ROOT / name for name in (".cargo/config.toml", "LICENSE", "pyproject.toml", "native/Cargo.lock")]
    assert len(wanted) > 500
    for path in wanted:
        name = path.relative_to(package.ROOT).as_posix()
        assert name in held, name
        assert path.suffix in (".toml", ".lock") or held[name] == path.read_bytes(), name
    assert b"sse4.2" in held[".cargo/config.toml"]
    assert not [name for name, content in held.items() if str(package.ROOT).encode() in content]
