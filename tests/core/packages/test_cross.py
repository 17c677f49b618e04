# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs for other systems: how they are built and run here, what is reported if they cannot, and the workflows."""

from __future__ import annotations

import functools
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from scripts import package, package_python
from scripts.systems import answers, cross, targets
from tests.one_line import told

ROOT = Path(__file__).resolve().parents[3]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))

Ran = list[tuple[list[str], dict[str, str]]]


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Ran:
    """The programs that cross starts, which all print one line of answers, with their environments.

    All compilers and runners are there, and the libraries of all systems.
    """
    seen: Ran = []

    def run(words: list[str], **named: Any) -> subprocess.CompletedProcess[str]:
        if words[0] == "/bin/rustc":
            return subprocess.CompletedProcess(words, 0, f"{tmp_path}\n", "")
        if words[-1].startswith("-print-file-name"):
            return subprocess.CompletedProcess(words, 0, "/lib/libgcc_s.so.1\n", "")
        seen.append((words, named.get("env", {})))
        return subprocess.CompletedProcess(words, 0, "kd sse4.2 10 5 400 abc\n", "")

    (tmp_path / "libstd-1.rlib").touch()
    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(targets, "here", lambda: "linux-x64")
    monkeypatch.setattr(targets.shutil, "which", lambda name: f"/bin/{name}")
    monkeypatch.delenv(cross.SHARE, raising=False)
    return seen


@pytest.mark.parametrize(
    ("name", "linker", "runner", "share"),
    [
        ("windows-x64", "/bin/x86_64-w64-mingw32-gcc", "/bin/wine", "1"),
        ("linux-arm64", "/bin/aarch64-linux-gnu-gcc", "/bin/qemu-aarch64 -L /usr/aarch64-linux-gnu", "11"),
    ],
)
def test_tests_of_another_system_run_in_its_runner(
    ran: Ran, monkeypatch: pytest.MonkeyPatch, name: str, linker: str, runner: str, share: str
) -> None:
    assert cross.main(["test", name, "contract"]) == 0
    monkeypatch.setenv(cross.SHARE, "3")
    assert cross.main(["test", name, "--crate", "halfspace_base"]) == 0
    (words, variables), (crate, shared) = ran
    triple = targets.TARGETS[name].triple
    assert (words[:2], words[-2:]) == (["cargo", "test"], ["--", "contract"])
    assert {"--workspace", triple} <= {*words}
    prefix = "CARGO_TARGET_" + triple.upper().replace("-", "_")
    expected = {cross.SHARE: share, f"{prefix}_LINKER": linker, f"{prefix}_RUNNER": runner}
    assert expected.items() <= variables.items()
    assert crate[-3:-1] == ["--package", "halfspace_base"]
    assert "--workspace" not in crate
    assert shared[cross.SHARE] == "3"


@pytest.mark.parametrize(
    ("name", "options", "variables"),
    [
        ("linux-x64", "--target x86_64-unknown-linux-gnu --zig --compatibility manylinux_2_28 -- UNWINDER", "ZIG"),
        ("linux-arm64", "--target aarch64-unknown-linux-gnu --zig --compatibility manylinux_2_28 -- UNWINDER", "ZIG"),
        ("windows-x64", "--target x86_64-pc-windows-gnu", "CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER"),
        ("windows-arm64", "--target aarch64-pc-windows-gnullvm --zig", "ZIG"),
        ("macos-arm64", f"--target aarch64-apple-darwin --zig -- -Clink-arg=-F{targets.FRAMEWORKS}", "ZIG"),
        ("macos-x64", f"--target x86_64-apple-darwin --zig -- -Clink-arg=-F{targets.FRAMEWORKS}", "ZIG"),
    ],
)
def test_a_wheel_for_another_system_is_linked_for_it(ran: Ran, name: str, options: str, variables: str) -> None:
    found, environment = targets.maturin(targets.TARGETS[name], Path("/env/python"))
    unwinder = Path("/lib/libgcc_s.so.1").resolve()
    assert " ".join(found) == options.replace("UNWINDER", f"-Clink-arg={unwinder}")
    # A linker that is named in the environment would replace zig.
    assert [*environment] == [variables.replace("ZIG", "CARGO_ZIGBUILD_PYTHON_PATH")]


@pytest.mark.parametrize(("words", "folder"), [([], ""), (["--interpreter", "python3.14t"], "-python3.14t")])
def test_a_wheel_without_a_global_lock_is_one_beside(
    ran: Ran, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str], folder: str
) -> None:
    built = []
    (made := tmp_path / "x.whl").touch()
    monkeypatch.setattr(package.environment, "prepare", lambda environment: None)
    monkeypatch.setattr(package.environment, "build_wheel", lambda *seen: built.append(seen) or (made, True))
    assert cross.main(["wheel", "macos-x64", *words, "--out", str(tmp_path / "out")]) == 0
    ((_, name, options, _),) = built
    assert name == f"wheel-macos-x64{folder}"
    assert options[: len(words) + 1] == [*words, "--target"]


def test_each_stub_of_a_framework_is_found_and_states_where_macos_has_it() -> None:
    stubs = sorted(targets.FRAMEWORKS.glob("*.framework/*.tbd"))
    assert [path.stem for path in stubs] == ["CoreFoundation", "IOKit"]
    for path in stubs:
        place = f"/System/Library/Frameworks/{path.parent.stem}.framework/Versions/A/{path.stem}"
        text = path.read_text(encoding="utf-8")
        assert f"install-name: '{place}'" in text
        assert "targets: [ x86_64-macos, arm64-macos ]" in text


LACKS = next((name for name in ("cargo", "qemu-aarch64", "aarch64-linux-gnu-gcc") if shutil.which(name) is None), "")
"""The first program without which nothing is compiled for ARM and run here."""


@pytest.mark.slow
@pytest.mark.skipif(bool(LACKS), reason=f"{LACKS} is not installed")
def test_a_crate_for_arm_is_compiled_and_its_tests_run(capfd: pytest.CaptureFixture[str]) -> None:
    target = targets.TARGETS["linux-arm64"]
    try:
        targets.variables(target)
    except targets.TargetError as error:
        pytest.skip(str(error))
    assert cross.main(["test", target.name, "--crate", "halfspace_base"]) == 0
    assert re.search(r"^test result: ok\. [1-9]\d* passed; 0 failed;", capfd.readouterr().out, re.MULTILINE)
    # A crate that does not exist is a failure, not a success without tests.
    assert told(cross, ["test", target.name, "--crate", "halfspace_nothing"], capfd).endswith("with status 101\n")


def test_this_system_is_compared_with_the_other(ran: Ran, capsys: pytest.CaptureFixture[str]) -> None:
    assert cross.main(["answers", "linux-arm64", "--rays", "10"]) == 0
    assert [("--target" in words, words[-1]) for words, _ in ran] == [(False, "10"), (True, "10")]
    assert capsys.readouterr().out.endswith("1 structures answer with the same bits: linux-x64, linux-arm64\n")


@pytest.mark.parametrize(
    ("other", "wrong"),
    [
        ("kd neon 10 5 400 abc\nbvh neon 10 5 300 abc\n", None),
        ("kd neon 10 5 400 abd\nbvh neon 10 5 300 abc\n", "kd: 10 5 400 abd, not 10 5 400 abc"),
        ("kd neon 10 5 404 abc\nbvh neon 10 5 300 abc\n", "kd: 10 5 404 abc, not 10 5 400 abc"),
        ("kd neon 10 5 400 abc\n", "bvh: only one of the two answers"),
        ("", "bvh: only one of the two answers"),
    ],
)
def test_any_difference_but_the_instruction_set_is_a_failure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], other: str, wrong: str | None
) -> None:
    (tmp_path / "a.txt").write_text("kd avx2 10 5 400 abc\nbvh avx2 10 5 300 abc\n", encoding="utf-8")
    (tmp_path / "b.txt").write_text(other, encoding="utf-8")
    assert cross.main(["agree", str(tmp_path / "a.txt"), str(tmp_path / "b.txt")]) == int(wrong is not None)
    said = capsys.readouterr().out
    assert (f"DIFFERENT b: {wrong}" in said) if wrong else ("2 structures answer with the same bits: a, b" in said)


def test_files_without_answers_do_not_agree() -> None:
    assert cross.differences("b", ["nothing"], ["nothing"]) == ["b: no structure answers"]


@pytest.mark.parametrize(
    ("words", "lacks", "line"),
    [
        (["test", "macos-arm64"], "", "programs for macos-arm64 run only on that system"),
        (["test", "windows-x64"], "wine", "wine, which windows-x64 needs, is not on the PATH: install Debian's "),
        (["answers", "linux-arm64"], "aarch64-linux-gnu-gcc", "aarch64-linux-gnu-gcc, which linux-arm64 needs"),
        (["test", "windows-x64"], "libstd-1.rlib", "Rust's standard library for windows-x64 is not installed: run `"),
        (["agree", "one"], "", "agree needs two files or more"),
        (["agree", "one", "two"], "", "[Errno 2] No such file or directory"),
    ],
)
def test_rejects_calls_that_cannot_work_in_one_line(
    ran: Ran,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    lacks: str,
    line: str,
) -> None:
    (tmp_path / lacks).unlink() if lacks.endswith("rlib") else None
    monkeypatch.setattr(targets.shutil, "which", lambda name: None if name == lacks else f"/bin/{name}")
    assert told(cross, words, capsys).startswith(f"cross: {line}")


def test_a_program_that_fails_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(cross.CrossError, match="ended with status 3"):
        cross.run([sys.executable, "-c", "import sys; sys.exit(3)"], {})


def test_the_systems_are_those_of_the_zips() -> None:
    assert set(targets.TARGETS) <= set(package.PLATFORMS.values())


def test_every_structure_answers_with_the_same_bits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "new" / "a.txt"
    assert answers.main(["--rays", "200", "--out", str(file)]) == 0
    lines = file.read_text(encoding="utf-8").splitlines()
    assert lines == capsys.readouterr().out.splitlines()
    assert len(cross.table(lines)) == len(lines)
    assert 0 < int(lines[0].split()[3]) < 200, "some rays hit, some miss"


def steps(text: str) -> list[str]:
    """The commands of a workflow with a system put in, one command a line."""
    found = re.findall(r"^ +(?:- )?run: ((?!\|).+)$", text, re.MULTILINE)
    values = {"${{ matrix.system }}": "linux-arm64", "$GITHUB_SERVER_URL": "https://example.org"}
    return [functools.reduce(lambda text, pair: text.replace(*pair), values.items(), line) for line in found]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_calls_scripts_as_they_are(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = path.read_text(encoding="utf-8")
    called = []
    for module, name in ((cross, "chosen"), (package, "run"), (package_python, "run")):
        monkeypatch.setattr(module, name, lambda asked: called.append(asked) or 0)
    for line in steps(text):
        program, *words = shlex.split(line)
        if program != "python":
            continue
        name, *given = words[1:] if words[0] == "-m" else [words[0].removesuffix(".py").replace("/", "."), *words[1:]]
        assert (ROOT / name.replace(".", "/")).with_suffix(".py").is_file(), line
        module = {module.__name__: module for module in (cross, package, package_python)}.get(name)
        if module is not None:
            assert module.main(given) == 0, line
    assert called
    systems = set(re.findall(r"system: ([\w-]+),", text))
    assert systems == set(targets.TARGETS) if path.stem == "release" else systems < set(targets.TARGETS)
