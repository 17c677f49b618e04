# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of the workflows: actionlint is built from locked versions, and what it finds is a failure."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
import workflows

FAULTS = {
    "nothing": ("", 0),
    "an unknown key": ("\n    timeout_minutes: 5", 1),
    "an unknown value": ("\n    if: matrix.nothing == github.nothing", 1),
}
"""What is added to a job, and the exit status."""


@pytest.mark.skipif(shutil.which("go") is None, reason="go is not installed")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_a_workflow_is_found(tmp_path: Path, capfd: pytest.CaptureFixture[str], fault: str) -> None:
    text = "on: push\njobs:\n  one:\n    runs-on: ubuntu-24.04\n    steps:\n      - run: python scripts/test.py"
    added, status = FAULTS[fault]
    folder = tmp_path / ".github" / "workflows"
    folder.mkdir(parents=True)
    (folder / "one.yml").write_text(f"{text}{added}\n", encoding="utf-8")
    assert workflows.check(tmp_path) == status
    assert ("one.yml:" if status else "1 workflows, nothing found") in capfd.readouterr().out


def test_without_go_or_with_a_failed_build_it_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    failed = subprocess.CompletedProcess([], 1, "", "go: downloading\ngo: checksum mismatch\n")
    monkeypatch.setattr(workflows.subprocess, "run", lambda *_, **__: failed)
    monkeypatch.setattr(workflows.shutil, "which", lambda name: name)
    assert workflows.main([]) == 2
    assert capsys.readouterr().err == "workflows: actionlint does not build: go: checksum mismatch\n"
    monkeypatch.setattr(workflows.shutil, "which", lambda _: None)
    assert workflows.main([]) == 2
    assert capsys.readouterr().err.startswith("workflows: go, which builds actionlint, is not on the PATH")
