# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C while a command is being loaded: one line and the status 130, no traceback and no crash."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from addon.core.base import interrupt

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a process cannot interrupt itself as from the keyboard")

SCRIPT = str(Path(__file__).resolve().parents[3] / "scripts" / "halfspace.py")

GUARDED = ("bench", "choose", "claims", "compare", "export", "render", "reported", "stability")
"""The commands that users run and that import more than Python's own modules."""

PROGRAM = """
import os, runpy, signal, sys
sys.path[:0] = {paths!r}
signal.signal(signal.SIGINT, signal.default_int_handler)

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder())
sys.argv = [{script!r}, *{arguments!r}]
runpy.run_path({script!r}, run_name="__main__")
"""


def interrupted(command: str, arguments: list[str], name: str) -> subprocess.CompletedProcess[str]:
    """Run a command that is interrupted as it imports the named module."""
    # Without the folders that Blender adds where a test of this process has imported it: there, bpy is another module.
    paths = [folder for folder in sys.path if "bpy" not in Path(folder).parts]
    program = PROGRAM.format(paths=paths, name=name, script=SCRIPT, arguments=[command, *arguments])
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=600, env=environment, check=False
    )


@pytest.mark.parametrize("name", GUARDED)
def test_an_interrupt_while_modules_are_imported(name: str, tmp_path: Path) -> None:
    done = interrupted(name, ["--out", str(tmp_path)], "numpy")
    assert (done.returncode, done.stderr) == (130, f"{name}: stopped\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(importlib.util.find_spec("bpy") is None, reason="needs Blender as a module")
@pytest.mark.parametrize("module", ["bl_ui", "pose_library"])
@pytest.mark.parametrize(
    ("name", "arguments"), [("render", []), ("bench", ["showcase", "--structures", "kd"]), ("compare", [])]
)
def test_an_interrupt_while_blender_is_imported(name: str, arguments: list[str], module: str, tmp_path: Path) -> None:
    out = tmp_path / "out.png" if name == "render" else tmp_path
    done = interrupted(name, [*arguments, "--out", str(out)], module)
    assert (done.returncode, done.stderr) == (130, f"{name}: stopped\n")
    assert {path.name for path in tmp_path.iterdir()} <= {"rows.jsonl"}


def test_a_program_that_was_not_guarded_keeps_its_handlers() -> None:
    before = signal.getsignal(signal.SIGINT)
    with interrupt.guarded(), interrupt.raising():
        assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt), interrupt.guarded():
        signal.raise_signal(signal.SIGINT)
