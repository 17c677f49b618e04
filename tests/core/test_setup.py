# SPDX-License-Identifier: GPL-3.0-or-later
"""The set-up: finding Pythons and libraries, counting tests, deciding what must be built, filling the manifest."""

from __future__ import annotations

import runpy
import subprocess
import sys
import threading
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
test_script = runpy.run_path(str(ROOT / "scripts" / "test.py"), run_name="script")
cargo_counts, Counts = test_script["cargo_counts"], test_script["Counts"]

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


def test_the_counts_of_cargo_add_up() -> None:
    text = (
        "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.1s\n"
        "     Running tests/contract.rs\n"
        "test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out\n"
    )
    assert str(cargo_counts(text)) == "15 passed, 2 failed, 1 skipped"
    assert cargo_counts("error: could not compile") == Counts()


SKIPPED = "import pytest\n@pytest.mark.skip(reason='x')\ndef test_a(): pass\n"


@pytest.mark.parametrize(
    ("body", "expected", "status"),
    [
        ("def test_a(): pass\ndef test_b(): assert 0\n", {"passed": 1, "failed": 1, "skipped": 0}, 1),
        (
            "import pytest\n@pytest.mark.skip(reason='x')\ndef test_a(): pass\n",
            {"passed": 0, "failed": 0, "skipped": 1},
            0,
        ),
        (
            "import pytest\n@pytest.fixture\ndef f():\n    yield\n    assert 0\ndef test_a(f): pass\n",
            {"passed": 0, "failed": 1, "skipped": 0},
            1,
        ),
        ("import nothing_of_this_name\n", {"passed": 0, "failed": 1, "skipped": 0}, 2),
        ("import warnings\ndef test_a(): warnings.warn('x')\n", {"passed": 0, "failed": 1, "skipped": 0}, 1),
        ("", {"passed": 0, "failed": 0, "skipped": 0}, 5),
    ],
)
def test_the_runner_counts_tests(tmp_path: Path, body: str, expected: dict[str, int], status: int) -> None:
    import json

    (tmp_path / "test_it.py").write_text(body)
    counts = tmp_path / "counts.json"
    options = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(tmp_path), "-p", "no:cacheprovider"]
    command = [sys.executable, str(ROOT / "tests" / "run.py"), "--counts", str(counts), *options, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert json.loads(counts.read_text()) == expected, done.stdout
    assert done.returncode == status


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


def test_a_check_that_hangs_ends_with_all_that_it_started(tmp_path, monkeypatch, capsys):
    run = test_script["run"]
    monkeypatch.setitem(run.__globals__, "TIME_LIMIT", 1)
    late = tmp_path / "late"
    grandchild = f"import time, pathlib; time.sleep(12); pathlib.Path({str(late)!r}).touch()"
    child = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {grandchild!r}])"
    status, _ = run([sys.executable, "-c", child])
    # What was started holds on to the output, so nothing returns before it has ended, one way or the other.
    assert not late.exists()
    assert status != 0
    assert "ended after 1 s" in capsys.readouterr().out
