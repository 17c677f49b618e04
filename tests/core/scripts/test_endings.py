# SPDX-License-Identifier: GPL-3.0-or-later
"""How command lines end that are stopped, or whose output goes where it cannot be written: one line and a status."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from addon.core.base import command, native
from scripts import demo, test
from scripts.dev import mutations
from tests.commands import COMMANDS

ROOT = Path(__file__).resolve().parents[3]
FULL = Path("/dev/full")

MEASURED = ["stability", "--structures", "bih:shadow=none", "--scenes", "grid", "--rays", "64"]
SHORT = ["bench", "grid", "--structures", "kd", "--size", "8x8", "--repeats", "1", "--check-rays", "64"]
SHORT += ["--seconds", "1", "--rays", "primary", "--only-rays", "--curve", "none"]


def started(arguments: list[str], **named: Any) -> subprocess.Popen[str]:
    """A command, or a script, in a process of its own."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **named.pop("environment", {})}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    words = arguments if arguments[0].endswith(".py") else ["halfspace.py", *arguments]
    program = [sys.executable, str(ROOT / "scripts" / words[0]), *words[1:]]
    named = {"encoding": "utf-8", **named}
    if os.name == "posix":
        # What a script runs in the background ignores interrupts, and so would what it starts.
        named["preexec_fn"] = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    return subprocess.Popen(program, stderr=subprocess.PIPE, env=environment, **named)


def interrupt(*_: object, **__: object) -> Any:
    raise KeyboardInterrupt


@pytest.mark.parametrize("name", COMMANDS)
def test_ctrl_c_is_one_line_and_status_130(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command.argparse.ArgumentParser, "parse_args", interrupt)
    assert COMMANDS[name].main(["--out", str(tmp_path)]) == 130
    assert capsys.readouterr() == ("", f"{name}: stopped\n")


@pytest.mark.parametrize(("tool", "first"), [(demo, "work"), (mutations, "check"), (test, "work")])
def test_ctrl_c_ends_the_tools_of_developers_alike(
    tool: Any, first: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tool, first, interrupt)
    assert tool.main([]) == 130
    assert capsys.readouterr() == ("", f"{tool.__name__.rpartition('.')[2]}: stopped\n")


@pytest.mark.parametrize("name", ["bench", "claims", "stability"])
def test_names_the_kept_results(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native, "load", interrupt)
    folder = tmp_path / "out"
    assert COMMANDS[name].main(["--out", str(folder)]) == 130
    assert capsys.readouterr().err == f"{name}: stopped\n", "nothing is there"
    folder.mkdir()
    (folder / "rows.jsonl").write_text('{"options": {}}\n')
    assert COMMANDS[name].main(["--out", str(folder)]) == 130
    assert capsys.readouterr().err == f"{name}: stopped\n", "nothing of ours is there"
    (folder / "rows.jsonl").write_text('{"key": "of a row"}\n')
    assert COMMANDS[name].main(["--out", str(folder)]) == 130
    assert capsys.readouterr().err == f"{name}: stopped; what was finished is kept in {folder}\n"


@pytest.mark.skipif(sys.platform == "win32", reason="no process can be interrupted as from the keyboard")
def test_a_long_run_that_is_interrupted(tmp_path: Path) -> None:
    journal = tmp_path / "rows.jsonl"
    asked = ["stability", "--structures", "bih:shadow=none", "--long", "1e15", "--threads", "1"]
    run = started([*asked, "--out", str(tmp_path)], stdout=subprocess.PIPE)
    try:
        for _ in range(3000):
            if journal.is_file() and '"key"' in journal.read_text(encoding="utf-8"):
                break
            time.sleep(0.1)
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=300)
    finally:
        run.kill()
        run.wait()
    assert (said, run.returncode) == (f"stability: stopped; what was finished is kept in {tmp_path}\n", 130)


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp437"])
def test_escapes_characters_that_an_encoding_lacks(encoding: str) -> None:
    environment = {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    run = started(MEASURED, stdout=subprocess.PIPE, encoding=encoding, environment=environment)
    told, said = run.communicate(timeout=300)
    assert (said, run.returncode) == ("", 0)
    assert "|\\u0394t| ulps" in told


@pytest.mark.skipif(not FULL.exists(), reason="this system has no file that is always full")
@pytest.mark.parametrize(
    "arguments", [MEASURED, SHORT, ["claims", "list"], ["thesis", "--help"]], ids=lambda some: some[0]
)
def test_a_full_standard_output_is_status_2(arguments: list[str]) -> None:
    with FULL.open("w") as full:
        run = started(arguments, stdout=full)
        _, said = run.communicate(timeout=300)
    name = arguments[0].removesuffix(".py")
    assert said == f"{name}: standard output cannot be written: No space left on device\n"
    assert run.returncode == 2


def test_no_standard_output_at_all_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    assert COMMANDS["claims"].main(["list"]) == 0


@pytest.mark.parametrize(
    ("message", "line", "first"),
    [
        ("Error: interrupted\nError: interrupted", "interrupted", "interrupted"),
        ("one  thing\n and another ", "one thing and another", "one thing"),
        ("", "RuntimeError", "RuntimeError"),
        (
            'Error: Python: Traceback (most recent call last):\n  File "a.py"\nstruct.error: bad\nLocation: a.py\n',
            "struct.error: bad",
            "struct.error: bad",
        ),
        (
            (
                "Python: Traceback (most recent call last):\n  File 'a.py'\nstruct.error: bad\n\nThis caused:\n\n"
                "Traceback (most recent call last):\n  File 'b.py'\nImportError: glTF is broken\nLocation: b.py\n"
            ),
            "ImportError: glTF is broken",
            "ImportError: glTF is broken",
        ),
    ],
)
def test_shortens_an_error_to_one_line(message: str, line: str, first: str) -> None:
    assert native.in_one_line(RuntimeError(message)) == line
    assert native.first_line(RuntimeError(message)) == first
