# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheel and the extension's package: when it is built, what goes into it, where it runs."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import environment
import imports
import package
import package_python
import pytest
import targets
import wheel
from one_line import told


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The least that a fingerprint is made from."""
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
    before = wheel.fingerprint(project)
    path = project / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)
    assert (wheel.fingerprint(project) == before) is same


def test_everything_that_is_packaged_is_reached_by_the_extension(tmp_path: Path) -> None:
    package.stage([], tmp_path / "staged")
    staged = imports.modules(tmp_path / "staged", "addon")
    beside = ["addon.LICENSE", "addon.blender_manifest.toml", "addon.manual.md"]
    assert imports.unreached(staged, "addon") == beside
    assert "addon.core.report.page.html" in staged
    # The check can fail: a module without importers, and one that loses its only importer.
    (tmp_path / "staged" / "core" / "measure" / "orphan.py").write_text("from . import accuracy\n", encoding="utf-8")
    sky = tmp_path / "staged" / "blender" / "read" / "sky.py"
    sky.write_text(sky.read_text(encoding="utf-8").replace("sky_bake.py", "nothing.py"), encoding="utf-8")
    left = imports.unreached(imports.modules(tmp_path / "staged", "addon"), "addon")
    assert sorted({*left} - {*beside}) == ["addon.blender.read.sky_bake", "addon.core.measure.orphan"]


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
@pytest.mark.parametrize("program", [package, package_python])
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


def wheel_with(path: Path, *symbols: bytes) -> Path:
    """A wheel whose module names these versions of symbols."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("x/x.abi3.so", b"\x7fELF\0" + b"\0".join(symbols) + b"\0")
    return path


@pytest.mark.parametrize(
    ("symbols", "needed"),
    [
        ((b"GLIBC_2.2.5", b"GLIBC_2.17"), (2, 17)),
        ((b"GLIBC_2.28", b"GLIBC_2.4", b"GLIBC_PRIVATE"), (2, 28)),
        ((b"GLIBC_2.9", b"GLIBC_2.35", b"GLIBC_2.34"), (2, 35)),
        ((b"KERNEL32.dll",), (0, 0)),
    ],
)
def test_a_wheel_for_newer_systems_than_blender_s_is_told_when_it_is_packaged(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    symbols: tuple[bytes, ...],
    needed: tuple[int, int],
) -> None:
    path = wheel_with(tmp_path / "x-1-cp311-abi3-linux_x86_64.whl", *symbols)
    assert package.glibc_of(path) == needed
    monkeypatch.setattr(package, "stage", lambda *_, **__: None)
    monkeypatch.setattr(package, "run_tool", lambda *words: Path(words[-1]).touch() if words[0] == "build" else None)
    assert package.main(["--wheel", str(path), "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().err
    if needed <= (2, 28):
        assert not said
    else:
        assert said.startswith(f"package: WARNING: {path.name} needs glibc 2.35 or newer, Blender only 2.28: ")
        assert "package with --portable, or build the wheel there" in said


NAME = "x-1-cp311-abi3-manylinux_2_28_x86_64.whl"


@pytest.fixture
def builds(project: Path, monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[str], dict[str, str]]]:
    """The arguments and the environments of maturin, which leaves an empty wheel instead of a build."""
    seen: list[tuple[list[str], dict[str, str]]] = []

    def run(command: list[str], **named: Any) -> subprocess.CompletedProcess[str]:
        if command[0] == "cc":
            return subprocess.CompletedProcess(command, 0, "/lib/libgcc_s.so.1\n", "")
        seen.append((command, named["env"]))
        out = Path(command[command.index("--out") + 1])
        out.mkdir(parents=True)
        wheel_with(out / NAME)
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(wheel.subprocess, "run", run)
    monkeypatch.setattr(wheel.shutil, "which", lambda name: f"/bin/{name}")
    return seen


def test_the_portable_wheel_is_kept_beside_the_usual_one(
    project: Path, builds: list[tuple[list[str], dict[str, str]]]
) -> None:
    python = Path("/env/bin/python")
    usual = wheel.build(project, python)
    portable = wheel.build(project, python, glibc=(2, 28))
    assert usual == (project / "build" / "wheel" / NAME, True)
    assert portable == (project / "build" / "wheel-manylinux_2_28" / NAME, True)
    assert wheel.build(project, python) == (usual[0], False)
    assert wheel.build(project, python, glibc=(2, 28)) == (portable[0], False)
    (first, _), (second, variables) = builds
    assert "--zig" not in first
    assert second[-5:-1] == ["--zig", "--compatibility", "manylinux_2_28", "--"]
    assert Path(second[-1].removeprefix("-Clink-arg=")).name.startswith("libgcc_s.so")
    assert variables["CARGO_ZIGBUILD_PYTHON_PATH"] == str(python), "zig need not be on the PATH"


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """All compilers, runners and libraries of all systems."""
    monkeypatch.setattr(targets.shutil, "which", lambda name: f"/bin/{name}")
    monkeypatch.setattr(targets, "library", lambda target: Path("/lib"))
    monkeypatch.setattr(targets, "here", lambda: "linux-x64")


@pytest.mark.parametrize(
    ("name", "glibc", "folder", "options"),
    [
        (
            "linux-x64",
            (2, 28),
            "wheel-manylinux_2_28",
            "--interpreter /env/python --zig --compatibility manylinux_2_28",
        ),
        (
            "linux-arm64",
            (2, 28),
            "wheel-linux-arm64-manylinux_2_28",
            "--target aarch64-unknown-linux-gnu --zig --compatibility manylinux_2_28",
        ),
        ("windows-x64", (2, 28), "wheel-windows-x64", "--target x86_64-pc-windows-gnu"),
        ("macos-arm64", (2, 28), "wheel-macos-arm64", "--target aarch64-apple-darwin --zig"),
    ],
)
def test_a_wheel_for_another_system_is_linked_for_it(
    installed: None,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    glibc: tuple[int, int],
    folder: str,
    options: str,
) -> None:
    compilers: list[str] = []
    monkeypatch.setattr(wheel, "unwinder", lambda compiler: compilers.append(compiler) or Path("/lib/libgcc_s.so.1"))
    found, words, variables = wheel.arguments(Path("/env/python"), glibc, targets.TARGETS[name])
    assert found == folder
    assert " ".join(words).partition(" -- ")[0] == options
    assert compilers == {"linux-x64": ["cc"], "linux-arm64": ["aarch64-linux-gnu-gcc"]}.get(name, [])
    linkers = {key: value for key, value in variables.items() if key.endswith("_LINKER")}
    assert (f"-Clink-arg=-F{targets.FRAMEWORKS}" in words) == (name == "macos-arm64")
    # Zig must not be replaced by a linker that is named in the environment.
    expected = {"CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER": "/bin/x86_64-w64-mingw32-gcc"}
    assert linkers == (expected if name == "windows-x64" else {})


def test_each_stub_of_a_framework_is_found_and_states_where_macos_has_it() -> None:
    stubs = sorted(targets.FRAMEWORKS.glob("*.framework/*.tbd"))
    assert [path.stem for path in stubs] == ["CoreFoundation", "IOKit"]
    for path in stubs:
        assert path.parent.stem == path.stem
        place = f"/System/Library/Frameworks/{path.stem}.framework/Versions/A/{path.stem}"
        assert f"install-name: '{place}'" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("there", "line"),
    [(None, "cc is not on the PATH: install gcc"), ("/bin/cc", r"cc finds no libgcc_s\.so\.1: install gcc")],
)
def test_what_the_portable_wheel_lacks_is_told(
    project: Path, monkeypatch: pytest.MonkeyPatch, there: str | None, line: str
) -> None:
    monkeypatch.setattr(wheel.shutil, "which", lambda name: there if name == "cc" else name)
    unknown = subprocess.CompletedProcess([], 0, "libgcc_s.so.1\n", "")
    monkeypatch.setattr(wheel.subprocess, "run", lambda *_, **__: unknown)
    with pytest.raises(wheel.BuildError, match=line):
        wheel.build(project, Path("/env/bin/python"), glibc=(2, 28))


@pytest.mark.parametrize(
    ("system", "portable", "glibc", "prepared"),
    [
        ("linux", True, (2, 28), [environment.PORTABLE]),
        ("linux", False, None, []),
        ("darwin", True, None, []),
    ],
)
def test_what_is_asked_for_is_bundled_beside_what_is_given(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    system: str,
    portable: bool,
    glibc: tuple[int, int] | None,
    prepared: list[environment.Environment],
) -> None:
    ready: list[environment.Environment] = []
    asked: list[tuple[int, int] | None] = []
    bundled: list[str] = []

    def build(
        _: Path, __: Path, *, glibc: tuple[int, int] | None = None, target: targets.Target | None = None
    ) -> tuple[Path, bool]:
        assert target is None or target.is_here
        asked.append(glibc)
        return wheel_with(tmp_path / NAME), True

    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "prepare_packages", ready.append)
    monkeypatch.setattr(package.wheel, "build", build)
    monkeypatch.setattr(package, "stage", lambda wheels, *_, **__: bundled.extend(path.name for path in wheels))
    monkeypatch.setattr(package, "run_tool", lambda *words: Path(words[-1]).touch() if words[0] == "build" else None)
    given = wheel_with(tmp_path / "x-1-cp311-abi3-win_amd64.whl")
    arguments = ["--portable", "--wheel", str(given)] if portable else []
    assert package.main([*arguments, "--out", str(tmp_path)]) == 0
    assert asked == [glibc]
    assert ready == prepared
    assert bundled == [given.name] * portable + [NAME]


@pytest.mark.parametrize("given", [["--for", "windows-x64", "--for", "linux-x64"], ["--for", "all"], ["--wheel", "."]])
def test_each_system_gets_a_zip_of_its_own_next_to_the_one_for_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    tags = {"linux-x64": "manylinux_2_28_x86_64", "linux-arm64": "manylinux_2_28_aarch64", "windows-x64": "win_amd64"}
    tags["macos-arm64"] = "macosx_11_0_arm64"
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


def test_an_empty_folder_of_wheels_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert package.main(["--wheel", str(tmp_path), "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "package: the folders hold no wheels\n"


def test_an_environment_that_cannot_be_set_up_ends_packaging_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_: environment.Environment) -> None:
        raise environment.SetupError("pip failed in .venv-portable")

    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "prepare_packages", fail)
    assert package.main(["--portable", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "package: pip failed in .venv-portable\n"


def test_a_wheel_that_is_none_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x-1-cp311-abi3-linux_x86_64.whl"
    path.write_bytes(b"no wheel")
    assert package.main(["--wheel", str(path), "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"package: {path}: not a wheel: File is not a zip file\n"
