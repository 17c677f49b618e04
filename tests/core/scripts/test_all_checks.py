# SPDX-License-Identifier: GPL-3.0-or-later
"""`scripts/test.py`, which runs every check: what fails is counted as failed, and the exit status tells it."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import Any

import environment
import pytest

ROOT = environment.ROOT
test_script = runpy.run_path(str(ROOT / "scripts" / "test.py"), run_name="script")
cargo_counts, Counts = test_script["cargo_counts"], test_script["Counts"]


def test_the_counts_of_cargo_add_up() -> None:
    text = (
        "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.1s\n"
        "     Running tests/contract.rs\n"
        "test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out\n"
    )
    assert str(cargo_counts(text)) == "15 passed, 2 failed, 1 skipped"
    assert cargo_counts("error: could not compile") == Counts()


def test_a_gate_passes_by_its_exit_status_alone() -> None:
    for status, expected in ((0, Counts(passed=1)), (3, Counts(failed=1))):
        assert test_script["gate"](sys.executable, "-c", f"raise SystemExit({status})")() == expected


@pytest.mark.parametrize(
    ("status", "counted", "expected"),
    [
        (0, '{"passed": 2, "failed": 0, "skipped": 1}', Counts(2, 0, 1)),
        (1, '{"passed": 2, "failed": 1, "skipped": 0}', Counts(2, 1, 0)),
        # What ends badly has failed, whatever it counted.
        (139, '{"passed": 2, "failed": 0, "skipped": 0}', Counts(2, 1, 0)),
        (5, '{"passed": 0, "failed": 0, "skipped": 0}', Counts(0, 1, 0)),
        (2, None, Counts(0, 1, 0)),
    ],
)
def test_a_tier_fails_by_its_counts_and_by_its_exit_status(
    monkeypatch: pytest.MonkeyPatch, status: int, counted: str | None, expected: Any
) -> None:
    tier = test_script["pytest_tier"]

    def run(command: list[str]) -> tuple[int, str]:
        if counted is not None:
            Path(command[command.index("--counts") + 1]).write_text(counted)
        return status, ""

    monkeypatch.setitem(tier.__globals__, "run", run)
    assert tier(environment.CURRENT, "tests/core")() == expected


@pytest.mark.parametrize(
    ("status", "line", "expected"),
    [
        (0, "test result: ok. 2 passed; 0 failed; 1 ignored;", Counts(2, 0, 1)),
        (101, "test result: FAILED. 2 passed; 1 failed; 0 ignored;", Counts(2, 1, 0)),
        (101, "test result: ok. 2 passed; 0 failed; 0 ignored;", Counts(2, 1, 0)),
        (101, "error: could not compile", Counts(0, 1, 0)),
    ],
)
def test_rust_tests_fail_by_their_counts_and_by_their_exit_status(
    monkeypatch: pytest.MonkeyPatch, status: int, line: str, expected: Any
) -> None:
    rust_tests = test_script["RustTests"]
    program = [sys.executable, "-c", f"print({line!r}); raise SystemExit({status})"]
    real = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda _command, **options: real(program, **options))
    with ExitStack() as beside:
        rust = rust_tests()
        beside.callback(rust.close)
        assert rust.counts() == expected


@pytest.fixture
def checks(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Three checks in place of the project's, and those of them that were run."""
    ran: list[str] = []
    found = {"good": Counts(passed=1), "bad": Counts(passed=5, failed=1), "skipped": Counts(skipped=1)}

    def check(name: str) -> Any:
        return lambda: ran.append(name) or found[name]

    everything = test_script["main"].__globals__
    monkeypatch.setitem(everything, "CHECKS", {name: check(name) for name in found})
    monkeypatch.setitem(everything, "set_up", lambda *_: test_script["Ready"]())
    monkeypatch.setattr(environment, "alone", nullcontext)
    return ran


@pytest.mark.parametrize(
    ("wanted", "status"),
    [(["good"], 0), (["good", "skipped"], 0), (["good", "bad"], 1), (["bad"], 1), (["skipped"], 1)],
)
def test_a_failed_check_and_no_passed_one_are_status_1(checks: list[str], wanted: list[str], status: int) -> None:
    assert test_script["main"](wanted) == status
    assert sorted(checks) == sorted(wanted)


def test_a_set_up_that_fails_is_status_1(
    checks: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any) -> Any:
        raise environment.SetupError("no network")

    monkeypatch.setitem(test_script["main"].__globals__, "set_up", fail)
    assert test_script["main"](["good"]) == 1
    assert "no network" in capsys.readouterr().out
    assert not checks


def test_a_broken_lts_fails_its_own_check_alone(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    def prepare(where: environment.Environment) -> None:
        if where == environment.LTS:
            raise environment.SetupError("no network")

    wheels: list[environment.Environment] = []
    monkeypatch.setattr(environment, "prepare", prepare)
    monkeypatch.setattr(environment, "available", lambda _: True)
    monkeypatch.setattr(environment, "install_wheel", lambda *them: wheels.extend(them))
    monkeypatch.setattr(environment, "alone", nullcontext)
    everything = test_script["main"].__globals__
    passing = dict.fromkeys(("core", "blender-lts"), lambda: Counts(passed=1))
    monkeypatch.setitem(everything, "CHECKS", passing)
    assert test_script["main"](["core", "blender"]) == 1
    told = capsys.readouterr().out
    assert "blender-lts fails: no network" in told
    assert told.splitlines()[-1] == "1 passed, 1 failed, 0 skipped"
    assert wheels == [environment.CURRENT]


@pytest.mark.parametrize("wanted", [["nosuch"], ["good", "nosuch"]])
def test_an_unknown_check_is_refused_beside_known_ones_too(
    checks: list[str], capsys: pytest.CaptureFixture[str], wanted: list[str]
) -> None:
    assert test_script["main"](wanted) == 2
    assert capsys.readouterr().err == "test: no check is called 'nosuch'; there are good, bad, skipped, rust\n"
    assert not checks


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
    (tmp_path / "test_it.py").write_text(body)
    counts = tmp_path / "counts.json"
    options = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(tmp_path), "-p", "no:cacheprovider"]
    command = [sys.executable, str(ROOT / "tests" / "run.py"), "--counts", str(counts), *options, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert json.loads(counts.read_text()) == expected, done.stdout
    assert done.returncode == status


@pytest.mark.parametrize(
    "body",
    [
        "import time\ndef test_it(): time.sleep(60)\n",
        # Hypothesis would try it again and again, since a test that is ended by a signal has failed.
        "import time, hypothesis as h\n@h.given(h.strategies.none())\ndef test_it(n): time.sleep(60)\n",
    ],
)
def test_a_test_that_hangs_is_named_and_ends_all(tmp_path: Path, body: str) -> None:
    (tmp_path / "test_it.py").write_text("def test_before(): pass\n" + body)
    counts = tmp_path / "counts" / "counts.json"
    counts.parent.mkdir()
    options = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(tmp_path), "-p", "no:cacheprovider", "--timeout=2"]
    command = [sys.executable, str(ROOT / "tests" / "run.py"), "--counts", str(counts), *options, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert ", in test_it\n" in done.stdout + done.stderr
    assert json.loads(counts.read_text()) == {"passed": 1, "failed": 0, "skipped": 0}, "what came before is counted"


def test_what_a_failed_check_said_last_is_said_beside_the_summary(
    checks: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = "".join(f"line {n}\n" for n in range(100))
    failing = test_script["gate"](sys.executable, "-c", f"print({lines!r}); raise SystemExit(1)")
    everything = test_script["main"].__globals__
    monkeypatch.setitem(everything, "CHECKS", {**everything["CHECKS"], "bad": failing})
    assert test_script["main"](["bad", "good"]) == 1
    told = capsys.readouterr().out.partition("==== bad failed, and said last:\n")[2]
    assert told.splitlines()[:9] == [*(f"line {n}" for n in range(92, 100)), ""]
    assert "==== Summary after" in told


def test_a_check_that_hangs_ends_with_all_that_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
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
