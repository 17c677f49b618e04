# SPDX-License-Identifier: GPL-3.0-or-later
"""The native module's absence or age is one readable line; core stays free of Blender."""

import argparse
import ast
import os
import subprocess
import sys
import tomllib
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

from addon.core.base import command, native

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def _fresh() -> Iterator[None]:
    native.load.cache_clear()
    yield
    native.load.cache_clear()


def test_a_missing_module_is_reported_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "halfspace_native", None)
    assert native.problem() == (
        "The native module of Halfspace is not installed: "
        "install the Python package halfspace-rt again, or run scripts/demo.py in a clone"
    )
    with pytest.raises(native.NativeError):
        native.load()


def test_another_version_asks_for_a_restart(monkeypatch: pytest.MonkeyPatch) -> None:
    other = types.SimpleNamespace(__version__="9.9.9")
    monkeypatch.setitem(sys.modules, "halfspace_native", other)
    problem = native.problem() or ""
    assert "9.9.9" in problem
    assert "restart Blender" in problem


def test_all_versions_agree() -> None:
    files = {
        "blender_manifest.toml": [],
        "pyproject.toml": ["project"],
        "distribution/pyproject.toml": ["project"],
        "native/Cargo.toml": ["workspace", "package"],
    }
    for name, keys in files.items():
        table = tomllib.loads((ROOT / name).read_text(encoding="utf-8"))
        for key in keys:
            table = table[key]
        assert table["version"] == native.VERSION, name


def test_core_imports_nothing_of_blender() -> None:
    forbidden = {"bpy", "bmesh", "mathutils", "gpu", "gpu_extras", "bpy_extras"}
    files = [*sorted((ROOT / "addon" / "core").rglob("*.py")), ROOT / "addon" / "__init__.py"]
    assert len(files) > 5
    for file in files:
        tree = ast.parse(file.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module or ""]
            assert not forbidden & {name.split(".")[0] for name in names}, file


# A thread of the kind that builds in the background, always inside the module; the interpreter ends, and while it takes
# itself apart it lets others run for a moment.
ENDING = """
import os, threading, time
import halfspace_native, numpy

corners = numpy.random.default_rng(1).random((30_000, 3), numpy.float32)
triangles = numpy.arange(30_000, dtype=numpy.int32).reshape(-1, 3)
inside = threading.Event()

def build():
    while True:
        halfspace_native.build(corners, triangles, "kd-sah")
        inside.set()

class Last:
    def __del__(self, sleep=time.sleep, write=os.write):
        sleep(1)
        write(1, b"ended")

numpy.last = Last()
threading.Thread(target=build, daemon=True).start()
inside.wait()
"""


def test_python_ends_while_a_thread_is_inside_the_module() -> None:
    search = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run([sys.executable, "-c", ENDING], env=search, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ended", "")


THREADS = """
import time
from pathlib import Path
import numpy as np
import halfspace_native as native

corners = np.random.default_rng(5).random((9000, 3), np.float32)
triangles = np.arange(9000, dtype=np.int32).reshape(-1, 3)
tasks = Path("/proc/self/task")
before = len(list(tasks.iterdir()))
for row in native.structures():
    native.build(corners, triangles, row["id"], threads=1)
    until = time.monotonic() + 300
    while len(list(tasks.iterdir())) > before:  # a build's threads need a moment to end
        if time.monotonic() > until:
            raise SystemExit(row["id"])
        time.sleep(0.01)
"""


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="this system does not list a process's threads")
def test_threads_of_builds_end_with_them() -> None:
    # In a process of its own: threads that work for no build in particular stay until the end.
    search = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run([sys.executable, "-c", THREADS], env=search, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


class PanicException(BaseException):
    """Stands for PyO3's class."""


def test_the_reason_of_an_error_is_one_line_and_the_end_of_the_program_stays_one() -> None:
    assert native.reason(ValueError("a\n b")) == "a b"
    assert native.reason(KeyError()) == "KeyError"
    assert native.reason(PanicException("out of\nbounds")) == "internal error: out of bounds"
    for end in (KeyboardInterrupt, SystemExit, GeneratorExit):
        with pytest.raises(end):
            native.reason(end())


def test_a_panic_ends_a_command_as_a_failure(capsys: pytest.CaptureFixture[str]) -> None:
    def work(_asked: object) -> int:
        raise PanicException("out of\nbounds")

    assert command.run("tool", [], lambda _: argparse.Namespace(), work) == command.BAD_INPUT
    assert capsys.readouterr().err == "tool: internal error: out of bounds\n"
