# SPDX-License-Identifier: GPL-3.0-or-later
"""The set-up: finding Pythons and libraries, deciding what must be built and installed, filling the manifest."""

from __future__ import annotations

import ast
import subprocess
import sys
import threading
import venv
import zipfile
from pathlib import Path
from typing import Any

import dependencies
import environment
import interpreters
import package
import pytest
import system_libraries
import wheel

ROOT = environment.ROOT

LDD = """\
\tlinux-vdso.so.1 (0x00007ffe)
\tlibX11.so.6 => /lib/x86_64-linux-gnu/libX11.so.6 (0x00007f1)
\tlibXfixes.so.3 => not found
\tlibSM.so.6 => not found
\tlibodd.so.9 => not found
\tlibSM.so.6 => not found
"""


@pytest.mark.parametrize(
    ("licence", "good"),
    [
        ("MIT", True),
        ("MIT/Apache-2.0", True),
        ("Unlicense OR MIT", True),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", True),
        ("Apache-2.0 WITH LLVM-exception", True),
        ("MIT AND Unlicense", False),
        ("(MIT OR Unlicense) AND Zlib", False),
        ("Apache-2.0 WITH other-exception", False),
        ("MIT OR", False),
        ("MIT )", False),
        ("", False),
    ],
)
def test_licences_are_read_as_expressions(licence: str, good: bool) -> None:
    allowed = {"MIT", "Apache-2.0", "Unicode-3.0", "Apache-2.0 WITH LLVM-exception"}
    assert dependencies.may_be_used(licence, allowed) is good


def test_a_dependency_that_may_not_be_used_is_named() -> None:
    rules = {"licenses": {"allow": ["MIT"]}}
    own = {"name": "own", "version": "1", "license": "MIT", "source": None}
    any_version = {"name": "loose", "req": "*", "source": dependencies.REGISTRY}
    theirs = {"version": "2", "source": dependencies.REGISTRY, "dependencies": []}
    packages = [
        {**own, "dependencies": [any_version]},
        {**theirs, "name": "good", "license": "MIT OR Zlib"},
        {**theirs, "name": "bad", "license": None},
        {**theirs, "name": "elsewhere", "license": "MIT", "source": "git+https://example.org/x"},
    ]
    found = list(dependencies.problems({"packages": packages}, rules))
    assert [sentence.split(":")[0] for sentence in found] == ["own 1", "bad 2", "elsewhere 2"]
    assert "any version of loose" in found[0]


def test_our_own_python_is_found_and_answers() -> None:
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    found = interpreters.find(version)
    assert found is not None
    assert interpreters.answers(found, version)
    assert not interpreters.answers(found, "3.99")


def test_no_python_is_invented() -> None:
    assert interpreters.find("3.99") is None


def test_a_python_that_cannot_make_environments_is_passed_over(tmp_path: Path) -> None:
    shim = tmp_path / "python3.11"
    shim.write_text("#!/bin/sh\necho 'command not found' >&2\nexit 127\n")
    shim.chmod(0o755)
    assert not interpreters.answers(shim, "3.11")
    assert not interpreters.answers(tmp_path / "absent", "3.11")


def test_versions_are_compared_as_numbers() -> None:
    names = [Path("3.13.9"), Path("3.13.10"), Path("3.13.0")]
    assert [p.name for p in interpreters.newest_first(iter(names))] == ["3.13.10", "3.13.9", "3.13.0"]


HERE = f"{sys.version_info.major}.{sys.version_info.minor}"


def files_of_pip(where: environment.Environment, *names: str) -> None:
    """Files as pip leaves them in an environment, the last one after all others."""
    folder = environment._package_folder(where, "pip-1.dist-info")
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).write_text("Metadata-Version: 2.1\nName: pip\nVersion: 1\n")


@pytest.mark.parametrize(
    ("names", "made_again"),
    [((), True), (("METADATA", "RECORD"), True), (("METADATA", "RECORD", "INSTALLER"), False)],
    ids=["ended before pip", "ended within pip", "whole"],
)
def test_an_environment_whose_making_was_cut_short_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...], made_again: bool
) -> None:
    where = environment.Environment("0", HERE, tmp_path / "env", ())
    venv.EnvBuilder(symlinks=True, with_pip=False).create(where.folder)
    if names:
        files_of_pip(where, *names)
    made: list[environment.Environment] = []
    monkeypatch.setattr(environment, "_create", made.append)
    monkeypatch.setattr(environment, "_install_requirements", lambda _: None)
    monkeypatch.setattr(environment.system_libraries, "provide", lambda _: [])
    environment.prepare(where)
    assert made == [where] * made_again


def test_missing_libraries_are_read_off_and_named_as_packages() -> None:
    names = system_libraries.parse_ldd(LDD)
    assert names == ["libSM.so.6", "libXfixes.so.3", "libodd.so.9"]
    assert system_libraries.packages(names) == ["libodd.so.9", "libsm6", "libxfixes3"]


def test_without_the_right_to_install_the_command_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(system_libraries, "missing", lambda _: ["libSM.so.6"])
    monkeypatch.setattr(system_libraries, "may_install", lambda: False)
    with pytest.raises(system_libraries.MissingLibrariesError, match=r"sudo apt-get install .* libsm6"):
        system_libraries.provide(tmp_path)


def test_with_the_right_they_are_installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    answers = iter([["libSM.so.6"], []])
    monkeypatch.setattr(system_libraries, "missing", lambda _: next(answers))
    monkeypatch.setattr(system_libraries, "may_install", lambda: True)
    commands: list[list[str]] = []

    def run(command: list[str], **_: Any) -> Any:
        commands.append(command)
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(system_libraries.subprocess, "run", run)
    assert system_libraries.provide(tmp_path) == ["libsm6"]
    assert commands[0] == ["apt-get", "update"]
    assert commands[1][-1] == "libsm6"


def test_a_failed_installation_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(system_libraries, "missing", lambda _: ["libSM.so.6"])
    monkeypatch.setattr(system_libraries, "may_install", lambda: True)
    failed = subprocess.CompletedProcess([], 100, "", "E: Unable to fetch some archives")
    monkeypatch.setattr(system_libraries.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(system_libraries.MissingLibrariesError, match="Unable to fetch"):
        system_libraries.provide(tmp_path)


@pytest.mark.parametrize("folder", ["addon", "scripts", "tests"])
def test_nothing_needs_at_its_start_what_windows_has_not(folder: str) -> None:
    for path in (ROOT / folder).rglob("*.py"):
        for line in ast.parse(path.read_text(encoding="utf-8")).body:
            names = [alias.name for alias in line.names] if isinstance(line, ast.Import) else []
            names += [line.module] if isinstance(line, ast.ImportFrom) else []
            assert not {"fcntl", "grp", "pwd", "resource", "termios"} & set(names), f"{path}:{line.lineno}"


def test_the_installed_blender_lacks_nothing() -> None:
    bpy = pytest.importorskip("bpy", reason="Blender's module bpy is not installed in this environment")
    folder = next(p for p in Path(bpy.__file__).parents if p.name == "bpy" and any(p.glob("__init__*.so")))
    assert system_libraries.missing(folder) == []


def test_requirements_come_from_the_project_file() -> None:
    assert environment.requirements(environment.LTS.groups)[0].startswith("bpy==4.5")
    assert environment.requirements(environment.CURRENT.groups)[0].startswith("bpy==5.2")
    with pytest.raises(environment.SetupError, match="no dependency group 'nothing'"):
        environment.requirements(("nothing",))


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


def test_work_is_done_once_and_again_after_a_failure(tmp_path: Path) -> None:
    where = environment.Environment("0", "3.13", tmp_path, ())
    done: list[int] = []
    environment._once(where, "x", "a", lambda: done.append(1))
    environment._once(where, "x", "a", lambda: done.append(2))
    environment._once(where, "x", "b", lambda: done.append(3))

    def fail() -> None:
        raise environment.SetupError("no")

    with pytest.raises(environment.SetupError):
        environment._once(where, "x", "c", fail)
    environment._once(where, "x", "b", lambda: done.append(4))
    assert done == [1, 3, 4]


def test_another_wheel_of_the_same_name_is_installed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    where = environment.Environment("0", "3.13", tmp_path, ())
    path = tmp_path / "x-1-cp311-abi3-linux_x86_64.whl"
    monkeypatch.setattr(environment.wheel, "build", lambda *_: (path, True))
    installed: list[bytes] = []
    monkeypatch.setattr(environment, "_pip", lambda *_: installed.append(path.read_bytes()))
    for content in (b"one", b"one", b"two", b"two"):
        path.write_bytes(content)
        environment.install_wheel(where)
    assert installed == [b"one", b"two"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does without the lock")
def test_two_set_ups_take_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    order: list[str] = []

    def second() -> None:
        with environment.alone():
            order.append("second")

    thread = threading.Thread(target=second)
    with environment.alone():
        thread.start()
        thread.join(0.3)
        assert thread.is_alive(), "the second set-up waits"
        order.append("first")
    thread.join(30)
    assert order == ["first", "second"]
    assert "waiting for another set-up" in capsys.readouterr().out


MANIFEST = 'id = "x"\nversion = "1.2.3"\n\n[permissions]\nfiles = "Because"\n'


def test_the_manifest_gets_its_wheels_before_the_first_table() -> None:
    import tomllib

    names = ["x_native-1.2.3-cp311-abi3-win_amd64.whl", "x_native-1.2.3-cp311-abi3-manylinux_2_28_x86_64.whl"]
    filled = tomllib.loads(package.filled_manifest(MANIFEST, names))
    assert filled["wheels"] == sorted(f"./wheels/{name}" for name in names)
    assert filled["platforms"] == ["linux-x64", "windows-x64"]
    assert filled["permissions"] == {"files": "Because"}


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
    monkeypatch.setattr(package, "stage", lambda *_: None)
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

    def build(_: Path, __: Path, *, glibc: tuple[int, int] | None = None) -> tuple[Path, bool]:
        asked.append(glibc)
        return wheel_with(tmp_path / NAME), True

    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "prepare_packages", ready.append)
    monkeypatch.setattr(package.wheel, "build", build)
    monkeypatch.setattr(package, "stage", lambda wheels, _: bundled.extend(path.name for path in wheels))
    monkeypatch.setattr(package, "run_tool", lambda *words: Path(words[-1]).touch() if words[0] == "build" else None)
    given = wheel_with(tmp_path / "x-1-cp311-abi3-win_amd64.whl")
    arguments = ["--portable", "--wheel", str(given)] if portable else []
    assert package.main([*arguments, "--out", str(tmp_path)]) == 0
    assert asked == [glibc]
    assert ready == prepared
    assert bundled == [given.name] * portable + [NAME]


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


def test_tests_do_without_what_only_the_portable_wheel_needs() -> None:
    assert any(line.startswith("ziglang==") for line in environment.requirements(environment.PORTABLE.groups))
    for where in (environment.CURRENT, environment.LTS):
        assert not any("zig" in line for line in environment.requirements(where.groups))


def test_a_wheel_that_is_none_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x-1-cp311-abi3-linux_x86_64.whl"
    path.write_bytes(b"no wheel")
    assert package.main(["--wheel", str(path), "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"package: {path}: it is no wheel: File is not a zip file\n"


def test_the_versions_in_all_files_are_one() -> None:
    import tomllib

    from addon.core import native

    files = {"pyproject.toml": "project", "native/Cargo.toml": "package"}
    versions = {
        name: tomllib.loads((ROOT / name).read_text(encoding="utf-8"))[table]["version"]
        for name, table in files.items()
    }
    versions["manifest"] = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))["version"]
    assert set(versions.values()) == {native.VERSION}, versions
