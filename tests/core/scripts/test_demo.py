# SPDX-License-Identifier: GPL-3.0-or-later
"""`scripts/demo.py`: its steps are commands that the other scripts accept."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from addon.core.structures import catalogue
from addon.lab.commands import bench, render
from scripts import demo
from scripts.dev import environment
from tests.one_line import told


def test_the_picture_comes_first_and_every_step_is_a_valid_command() -> None:
    assert set(demo.GROUPS) <= set(environment.CURRENT.groups)
    picture, table = demo.STEPS.values()
    render.parser().parse_args(picture[1:])
    asked = bench.parser().parse_args(table[1:])
    assert [picture[0], table[0]] == ["scripts/render.py", "scripts/bench.py"]
    known = catalogue.load()
    named = [*asked.structures.split(","), *asked.inspector.split(",")]
    assert all(known.get(name) is not None for name in named)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The scripts that are run, of which render.py succeeds and bench.py fails with 1."""
    ran: list[str] = []

    def run(command: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        ran.append(Path(command[1]).name)
        return subprocess.CompletedProcess(command, int(ran[-1] == "bench.py"))

    for name in ("prepare", "install_wheel"):
        monkeypatch.setattr(environment, name, lambda *_: None)
    monkeypatch.setattr(demo.subprocess, "run", run)
    return ran


def test_a_step_that_fails_gives_its_exit_status(steps: list[str]) -> None:
    assert demo.main([]) == 1
    assert steps == ["render.py", "bench.py"]


def test_all_structures_are_one_command_away(
    steps: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(demo, "STEPS", {"rendering": ["scripts/render.py"]})
    assert demo.main([]) == 0
    words = capsys.readouterr().out.splitlines()[-1].split()
    assert bench.parser().parse_args(words[2:]).structures == "all"


def test_a_set_up_that_fails_is_status_2(
    steps: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any) -> None:
        raise environment.SetupError("no network")

    monkeypatch.setattr(environment, "prepare", fail)
    assert told(demo, [], capsys) == "The set-up failed: no network\n"
    assert not steps


@pytest.mark.parametrize(("script", "argument", "status"), [("demo.py", "--help", 0), ("test.py", "no-such-check", 2)])
def test_a_python_without_packages_starts_the_set_up(script: str, argument: str, status: int) -> None:
    path = environment.ROOT / "scripts" / script
    # A None in sys.modules makes each import of that package fail.
    code = f"import runpy, sys; sys.modules['numpy'] = None; sys.argv = [{script!r}, {argument!r}]; "
    code += f"runpy.run_path({str(path)!r}, run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
