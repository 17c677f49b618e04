# SPDX-License-Identifier: GPL-3.0-or-later
"""`scripts/test.py`, which runs every check: what fails is counted as failed, and the exit status tells it."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
import threading
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import environment
import pytest

ROOT = environment.ROOT
test_script = runpy.run_path(str(ROOT / "scripts" / "test.py"), run_name="script")
cargo_counts, Counts = test_script["cargo_counts"], test_script["Counts"]
everything = test_script["main"].__globals__
"""The names of the script, to be replaced."""


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
    monkeypatch.setitem(everything, "run", lambda _: (status, line + "\n"))
    assert test_script["rust_tests"]()() == expected


def fake_set_up(monkeypatch: pytest.MonkeyPatch) -> list[environment.Environment]:
    """Nothing is set up. Returns the environments into which the wheel was installed, filled later."""
    wheels: list[environment.Environment] = []
    monkeypatch.setattr(environment, "prepare", lambda _: None)
    monkeypatch.setattr(environment, "install_wheel", lambda *them: wheels.extend(them))
    monkeypatch.setattr(environment, "alone", nullcontext)
    return wheels


@pytest.fixture
def checks(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Four checks in place of the project's, and those of them that were run."""
    ran: list[str] = []
    found = {"good": Counts(passed=1), "bad": Counts(passed=5, failed=1), "skipped": Counts(skipped=1)}

    def check(name: str) -> Any:
        return lambda: ran.append(name) or found.get(name, Counts(passed=1))

    monkeypatch.setitem(everything, "CARGO_CHECKS", {"crates": check("crates")})
    monkeypatch.setitem(everything, "PYTHON_CHECKS", {name: check(name) for name in found})
    fake_set_up(monkeypatch)
    monkeypatch.setitem(everything, "NEED_WHEEL", {"good", "bad"})
    return ran


@pytest.mark.parametrize(
    ("wanted", "status"),
    [
        (["good"], 0),
        (["good", "skipped"], 0),
        (["crates", "good"], 0),
        (["good", "bad"], 1),
        (["bad"], 1),
        (["skipped"], 1),
    ],
)
def test_a_failed_check_and_no_passed_one_are_status_1(checks: list[str], wanted: list[str], status: int) -> None:
    assert test_script["main"](wanted) == status
    assert sorted(checks) == sorted(wanted)


def test_a_set_up_that_fails_is_status_1(
    checks: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any) -> Any:
        raise environment.SetupError("no network")

    stopped: list[bool] = []
    monkeypatch.setitem(everything, "RUNNING", SimpleNamespace(stop=lambda: stopped.append(True)))
    for name in ("install_wheel", "prepare"):
        monkeypatch.setattr(environment, name, fail)
        assert test_script["main"](["good"]) == 1
        assert "no network" in capsys.readouterr().out
    assert not checks
    assert stopped == [True, True], "checks that began meanwhile are ended"


@pytest.mark.parametrize(
    ("error", "status", "last"),
    [
        (environment.SetupError, 1, "1 passed, 1 failed, 0 skipped"),
        (environment.NoPythonError, 0, "1 passed, 0 failed, 1 skipped"),
    ],
)
def test_a_broken_lts_fails_its_own_check_alone_and_a_missing_python_skips_it(
    monkeypatch: pytest.MonkeyPatch, capsys: Any, error: type[Exception], status: int, last: str
) -> None:
    def prepare(where: environment.Environment) -> None:
        if where == environment.LTS:
            raise error("no network")

    wheels = fake_set_up(monkeypatch)
    monkeypatch.setattr(environment, "prepare", prepare)
    passing = dict.fromkeys(("core", "blender-lts"), lambda: Counts(passed=1))
    monkeypatch.setitem(everything, "CARGO_CHECKS", {})
    monkeypatch.setitem(everything, "PYTHON_CHECKS", passing)
    assert test_script["main"](["core", "blender"]) == status
    told = capsys.readouterr().out
    assert "no network" in told
    assert told.splitlines()[-1] == last
    assert wheels == [environment.CURRENT]


def test_checks_of_crates_begin_before_the_wheel_and_others_wait_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    order: list[str] = []
    began, installed = threading.Event(), threading.Event()

    def crates() -> Any:
        began.set()
        order.append("crates")
        return Counts(passed=1)

    def install(*_: Any) -> None:
        assert began.wait(300), "the crates are checked while the wheel is built"
        # The thread that is done with the crates waits, and takes nothing that needs the wheel.
        time.sleep(0.1)
        order.append("wheel")
        installed.set()

    def python() -> Any:
        assert installed.is_set()
        order.append("python")
        return Counts(passed=1)

    fake_set_up(monkeypatch)
    monkeypatch.setattr(environment, "install_wheel", install)
    monkeypatch.setitem(everything, "CARGO_CHECKS", {"crates": crates})
    monkeypatch.setitem(everything, "NEED_WHEEL", {"one"})
    monkeypatch.setitem(everything, "PYTHON_CHECKS", {"one": python, "two": python, "three": python})
    assert test_script["main"]([]) == 0
    assert order == ["crates", "wheel", "python", "python", "python"]


def test_linters_do_without_the_wheel(checks: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[bool] = []
    monkeypatch.setattr(environment, "install_wheel", lambda *_: built.append(True))
    assert test_script["main"](["crates", "skipped"]) == 0
    assert not built
    assert test_script["main"](["good"]) == 0
    assert built == [True]


def test_a_thread_without_checks_takes_the_last_of_the_other() -> None:
    both = test_script["Queue"](["a"], ["x", "y", "z"])
    both.ready.set()
    assert [both.take(0), both.take(0), both.take(1), both.take(1), both.take(0), both.take(1)] == [
        *("a", "z", "x", "y"),
        *(None, None),
    ]


def test_a_fault_of_this_script_in_either_thread_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> Any:
        raise ZeroDivisionError

    fake_set_up(monkeypatch)
    monkeypatch.setitem(everything, "RUNNING", SimpleNamespace(stop=lambda: None))
    for crates, python in (({"a": broken}, {}), ({}, {"a": broken})):
        monkeypatch.setitem(everything, "CARGO_CHECKS", crates)
        monkeypatch.setitem(everything, "PYTHON_CHECKS", python)
        with pytest.raises(ZeroDivisionError):
            test_script["main"]([])


@pytest.mark.parametrize("wanted", [["nosuch"], ["good", "nosuch"]])
def test_an_unknown_check_is_refused_beside_known_ones_too(
    checks: list[str], capsys: pytest.CaptureFixture[str], wanted: list[str]
) -> None:
    assert test_script["main"](wanted) == 2
    assert capsys.readouterr().err == "test: no check is called 'nosuch'; there are crates, good, bad, skipped\n"
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
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert json.loads(counts.read_text()) == expected | {"left_out": 0}, done.stdout
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
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 1
    assert ", in test_it\n" in done.stdout + done.stderr
    assert json.loads(counts.read_text()) == {"passed": 1, "failed": 0, "skipped": 0, "left_out": 0}, (
        "what came before is counted"
    )


def test_what_a_failed_check_said_last_is_said_beside_the_summary(
    checks: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = "".join(f"line {n}\n" for n in range(100))
    failing = test_script["gate"](sys.executable, "-c", f"print({lines!r}); raise SystemExit(1)")
    monkeypatch.setitem(everything, "PYTHON_CHECKS", {**everything["PYTHON_CHECKS"], "bad": failing})
    assert test_script["main"](["bad", "good"]) == 1
    told = capsys.readouterr().out.partition("==== bad failed, and said last:\n")[2]
    assert told.splitlines()[:9] == [*(f"line {n}" for n in range(92, 100)), ""]
    assert "==== Summary after" in told


@pytest.mark.parametrize(
    ("child", "limit", "words"),
    [
        ("pass", "SILENT_SECONDS", "printed nothing and did not work"),
        ("import itertools; all(map(lambda _: True, itertools.count()))", "SILENT_WORK", "printed nothing in"),
    ],
    ids=["asleep", "in a loop"],
)
def test_a_check_that_hangs_ends_with_all_that_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, child: str, limit: str, words: str
) -> None:
    run = test_script["run"]
    # The process of the child works at its start, too.
    monkeypatch.setitem(everything, "SILENT_SECONDS", 2.0 if limit == "SILENT_SECONDS" else 5.0)
    monkeypatch.setitem(everything, limit, 2.0)
    late = tmp_path / "late"
    grandchild = f"import time, pathlib; {child}; time.sleep(900); pathlib.Path({str(late)!r}).touch()"
    program = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {grandchild!r}])"
    began = time.monotonic()
    status, said = run([sys.executable, "-c", program])
    # The grandchild holds on to the output, so nothing returns before it has ended, one way or the other.
    assert time.monotonic() - began < 450
    assert not late.exists()
    assert status != 0
    assert words in said
    assert words in capsys.readouterr().out


@pytest.mark.parametrize(
    "body",
    [
        "import time\nfor n in range(8): print(n, flush=True); time.sleep(0.5)",
        "import time\nwhile time.process_time() < 3: pass",
    ],
    ids=["prints", "works"],
)
def test_a_check_that_prints_or_works_goes_on(monkeypatch: pytest.MonkeyPatch, body: str) -> None:
    monkeypatch.setitem(everything, "SILENT_SECONDS", 2.0)
    status, said = test_script["run"]([sys.executable, "-c", body])
    assert (status, "ended" in said) == (0, False)


def test_what_runs_is_ended_and_nothing_starts_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    running = test_script["Running"]()
    monkeypatch.setitem(everything, "RUNNING", running)
    statuses: list[int] = []
    started = threading.Event()
    monkeypatch.setitem(everything, "show", lambda _: started.set())
    program = [sys.executable, "-c", "import time; print(1, flush=True); time.sleep(300)"]
    thread = threading.Thread(target=lambda: statuses.append(test_script["run"](program)[0]))
    thread.start()
    assert started.wait(300)
    running.stop()
    thread.join(300)
    assert statuses
    assert statuses[0] != 0
    with pytest.raises(test_script["StoppedError"]):
        test_script["run"](program)


def test_a_day_leaves_out_what_only_a_release_needs_and_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands: list[list[str]] = []

    def run(command: list[str]) -> tuple[int, str]:
        slow = 0 if "not slow" not in command else 3
        Path(command[command.index("--counts") + 1]).write_text(json.dumps({"passed": 1, "left_out": slow}))
        commands.append(command[command.index("--counts") + 2 :])
        return 0, ""

    fake_set_up(monkeypatch)
    tier = everything["pytest_tier"](environment.LTS, "tests/blender", ["tests/blender/read"])
    monkeypatch.setitem(everything, "run", run)
    monkeypatch.setitem(everything, "CARGO_CHECKS", {"overflow": lambda: Counts(passed=1)})
    monkeypatch.setitem(everything, "PYTHON_CHECKS", {"blender-lts": tier})
    assert test_script["main"]([]) == 0
    said = capsys.readouterr().out
    assert "left out: the Rust tests with checks of overflow (--all runs it)" in said
    assert "left out: 3 slow tests (--all runs it)" in said
    assert "left out: in Blender LTS, all folders but installing" in said
    assert test_script["main"](["--all"]) == 0
    said = capsys.readouterr().out
    assert "left out" not in said
    assert said.endswith("2 passed, 0 failed, 0 skipped\n")
    assert commands == [["-m", "not slow", "tests/blender/read"], ["tests/blender"]]


def test_help_is_shown_without_a_set_up() -> None:
    command = [sys.executable, "-I", str(ROOT / "scripts" / "test.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.startswith("usage: test [-h] [--all] [CHECK ...]")
