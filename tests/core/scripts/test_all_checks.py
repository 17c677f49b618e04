# SPDX-License-Identifier: GPL-3.0-or-later
"""`scripts/test.py`, which runs every check: what fails is counted as failed, and the exit status tells it."""

from __future__ import annotations

import runpy
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from scripts.dev import environment

ROOT = environment.ROOT
script = runpy.run_path(str(ROOT / "scripts" / "test.py"), run_name="script")
main = script["main"]
names = main.__globals__
"""The names of the script, to be replaced."""

CARGO = ["cargo", "test"]
PYTEST = ["python", "-m", "pytest", "tests/core"]


@pytest.mark.parametrize(
    ("command", "status", "said", "expected"),
    [
        (["ruff"], 0, "12 passed", (1, 0, 0)),
        (["ruff"], 3, "", (0, 1, 0)),
        (CARGO, 0, "test result: ok. 12 passed; 0 failed; 1 ignored;\n" * 2, (24, 0, 2)),
        (CARGO, 101, "test result: FAILED. 2 passed; 1 failed; 0 ignored; 0 measured\n", (2, 1, 0)),
        # What ends badly has failed, whatever it counted.
        (CARGO, 101, "test result: ok. 2 passed; 0 failed; 0 ignored;\n", (2, 1, 0)),
        (CARGO, 101, "error: could not compile", (0, 1, 0)),
        (PYTEST, 0, "=== 2 passed, 1 skipped, 3 deselected, 1 xfailed in 70.12s (0:01:10) ===\n", (2, 0, 2)),
        (PYTEST, 1, "=== 5 passed in 1s ===\n== 1 failed, 2 passed, 2 errors in 0.1s ==\n", (2, 3, 0)),
        (PYTEST, 139, "=== 2 passed in 0.1s ===\n", (2, 1, 0)),
        (PYTEST, 5, "=== no tests ran in 0.1s ===\n", (0, 1, 0)),
        (PYTEST, 2, "", (0, 1, 0)),
    ],
)
def test_a_check_fails_by_its_counts_and_by_its_exit_status(
    command: list[str], status: int, said: str, expected: tuple[int, ...]
) -> None:
    counts = script["counted"](command, status, said)
    assert tuple(counts[word] for word in ("passed", "failed", "skipped")) == expected


ALL_ENDS = """
import pytest, warnings
def test_passes(): pass
def test_fails(): assert 0
def test_warns(): warnings.warn("x")
@pytest.mark.skip(reason="x")
def test_is_skipped(): pass
@pytest.fixture
def broken():
    yield
    assert 0
def test_with_a_broken_end(broken): pass
"""
HANGS = """
import time, hypothesis
# Hypothesis would try it again and again, since a test that is ended by a signal has failed.
@hypothesis.given(hypothesis.strategies.none())
def test_it(n): time.sleep(900)
"""


@pytest.mark.parametrize(
    ("body", "expected", "words"), [(ALL_ENDS, (2, 3, 1), "E   UserWarning: x"), (HANGS, (0, 1, 0), ", in test_it\n")]
)
def test_tests_are_counted_as_pytest_prints_them(
    tmp_path: Path, body: str, expected: tuple[int, ...], words: str
) -> None:
    (tmp_path / "test_it.py").write_text(body)
    options = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(tmp_path), "-p", "no:cacheprovider", "--timeout=5"]
    counts, said, _ = script["run"]("it", "", [sys.executable, "-m", "pytest", *options, str(tmp_path)])
    assert tuple(counts[word] for word in ("passed", "failed", "skipped")) == expected, said
    assert words in said


@pytest.fixture
def set_up(monkeypatch: pytest.MonkeyPatch) -> list[environment.Environment]:
    """Nothing is set up. The environments into which the wheel was installed, filled later."""
    wheels: list[environment.Environment] = []
    monkeypatch.setenv("HALFSPACE_TEST_SHARE", "1")
    monkeypatch.setattr(environment, "prepare", lambda _: None)
    monkeypatch.setattr(environment, "install_wheel", lambda *them: wheels.extend(them))
    monkeypatch.setattr(environment, "alone", nullcontext)
    return wheels


def of(code: str, *words: str) -> tuple[str, list[str]]:
    """A check that is a program in Python."""
    return "", [sys.executable, "-c", code, *words]


GOOD = of("print('== 1 passed in 0.1s ==')", "pytest")
BAD = of("print('\\n'.join(map(str, range(99)))); raise SystemExit(1)")
CHECKS = {"crates": ("", ["cargo", "--version"]), "good": of(""), "bad": BAD, "absent": ("no-such-program", [])}


@pytest.fixture
def ours(set_up: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four checks in place of the project's."""
    monkeypatch.setitem(names, "checks", lambda everything=True: dict(CHECKS))


@pytest.mark.parametrize(
    ("wanted", "status", "last"),
    [
        (["good"], 0, "1 passed, 0 failed, 0 skipped"),
        (["good", "absent"], 0, "1 passed, 0 failed, 1 skipped"),
        (["crates", "good"], 0, "2 passed, 0 failed, 0 skipped"),
        (["good", "bad"], 1, "1 passed, 1 failed, 0 skipped"),
        (["absent"], 1, "0 passed, 0 failed, 1 skipped"),
        ([], 1, "2 passed, 1 failed, 1 skipped"),
    ],
)
def test_a_failed_check_and_no_passed_one_are_status_1(
    ours: None, wanted: list[str], status: int, last: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(wanted) == status
    told = capsys.readouterr().out
    assert told.splitlines()[-1] == last
    assert ("==== bad failed, and said last:\n91\n92\n" in told) == ("1 failed" in last)
    assert ("not found: no-such-program" in told) == ("1 skipped" in last)


@pytest.mark.parametrize("wanted", [["nosuch"], ["good", "nosuch"]])
def test_an_unknown_check_is_refused_with_known_ones_too(
    ours: None, wanted: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(wanted)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.endswith("test: error: no check is called 'nosuch'; there are crates, good, bad, absent\n")


@pytest.mark.parametrize("step", ["prepare", "install_wheel"])
def test_a_set_up_that_fails_is_status_1_and_ends_all(
    set_up: Any, step: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any) -> Any:
        raise environment.SetupError("no network")

    monkeypatch.setitem(names, "checks", lambda everything=True: {"good": GOOD})
    monkeypatch.setattr(environment, step, fail)
    assert main([]) == 1
    said = capsys.readouterr().out
    assert "The set-up failed: no network" in said
    assert "==== good" not in said


@pytest.mark.parametrize(
    ("error", "status", "last"),
    [
        (environment.SetupError, 1, "1 passed, 1 failed, 0 skipped"),
        (environment.NoPythonError, 0, "1 passed, 0 failed, 1 skipped"),
    ],
)
def test_a_broken_lts_fails_its_own_check_alone_and_a_missing_python_skips_it(
    set_up: Any, monkeypatch: pytest.MonkeyPatch, capsys: Any, error: type[Exception], status: int, last: str
) -> None:
    def prepare(where: environment.Environment) -> None:
        if where == environment.LTS:
            raise error("no network")

    monkeypatch.setattr(environment, "prepare", prepare)
    monkeypatch.setitem(names, "checks", lambda everything=True: {"core": GOOD, "blender-lts": GOOD})
    assert main(["core", "blender"]) == status
    told = capsys.readouterr().out
    assert "no network" in told
    assert told.splitlines()[-1] == last
    assert set_up == [environment.CURRENT]


def test_a_wheel_is_made_for_tests_only(set_up: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(names, "checks", lambda everything=True: {"one": of(""), "two": GOOD})
    assert main(["one"]) == 0
    assert set_up == []
    assert main([]) == 0
    assert set_up == [environment.CURRENT]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows ends a process without what it started")
def test_a_check_that_is_stopped_ends_with_all_that_it_started(monkeypatch: pytest.MonkeyPatch) -> None:
    rest: list[str] = []

    def stop(line: str, **_: Any) -> None:
        if line == "begun\n":
            raise KeyboardInterrupt

    def end(process: Any) -> None:
        script["end"](process)
        # The grandchild holds on to the output: this returns when it has ended.
        rest.append(process.stdout.read())

    monkeypatch.setitem(names, "print", stop)
    monkeypatch.setitem(names, "end", end)
    grandchild = "print('begun', flush=True); import time; time.sleep(900)"
    with pytest.raises(KeyboardInterrupt):
        script["run"]("it", *of(f"import subprocess, sys; subprocess.run([sys.executable, '-c', {grandchild!r}])"))
    assert rest == [""]


def test_a_day_leaves_out_what_only_a_release_needs_and_says_so(
    set_up: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands: dict[str, list[str]] = {}

    def run(name: str, _: str, command: list[str]) -> Any:
        commands[name] = command
        return names["Counts"](passed=1), "", ""

    monkeypatch.setitem(names, "run", run)
    assert main([]) == 0
    said = capsys.readouterr().out
    for text in (
        "the Rust tests with checks of overflow",
        "slow tests",
        "in Blender LTS, all folders but installing",
    ):
        assert f"left out: {text}" in said
    assert "overflow" not in commands
    assert commands["blender-lts"][-8:-5] == ["-m", "not slow", "tests/blender/installing"]
    assert "halfspace_group" in commands["rust"]
    assert main(["--all"]) == 0
    assert "left out" not in capsys.readouterr().out
    assert commands["blender-lts"][-2:] == ["loadfile", "tests/blender"]
    assert "halfspace_group" not in commands["overflow"]


def test_help_is_shown_without_a_set_up() -> None:
    command = [sys.executable, "-I", str(ROOT / "scripts" / "test.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.startswith("usage: test [-h] [--all] [CHECK ...]")
