# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python package where its compiled module is missing or cannot run: commands and API report it in one sentence."""

from __future__ import annotations

import importlib.machinery
import os
import subprocess
import sys
from pathlib import Path

import halfspace_native
import pytest

from addon.core.base import native
from addon.lab.commands import launcher
from scripts import package_python

ABSENT = """raise ModuleNotFoundError("No module named 'halfspace_native'", name="halfspace_native")\n"""

OF_MATURIN = "from .halfspace_native import *\n"
"""The beginning of the wheel's `__init__.py`."""

OLD = """
import platform, sys
from pathlib import Path

true_text = Path.read_text

def text(path, *given, **named):
    return "flags : fpu sse sse2 sse4_1\\n" if path == Path("/proc/cpuinfo") else true_text(path, *given, **named)

Path.read_text = text
platform.machine = lambda: "x86_64"
if sys.platform == "win32":
    import ctypes
    ctypes.windll.kernel32.IsProcessorFeaturePresent = lambda feature: 0
"""
"""Starts with Python (`sitecustomize`): the processor has no SSE4.2 where `installation.has_sse42` reads it."""

DEADLY = "import os\nos.abort()\n"
"""Stands for an illegal instruction."""

FILES: dict[str, dict[str, str]] = {
    "absent": {"halfspace_native.py": ABSENT},
    "foreign": {"halfspace_native/__init__.py": OF_MATURIN, "halfspace_native/halfspace_native.none.so": ""},
    "broken": {
        "halfspace_native/__init__.py": OF_MATURIN,
        f"halfspace_native/halfspace_native{importlib.machinery.EXTENSION_SUFFIXES[-1]}": "no program\n",
    },
    "other version": {"halfspace_native.py": '__version__ = "9.9.9"\n'},
    "old processor": {"halfspace_native.py": DEADLY, "sitecustomize.py": OLD},
}
"""Files that shadow the module in the search path, by the fault."""

SENTENCES = {
    "absent": "The native module of Halfspace is not installed: install the Python package halfspace-rt again",
    "foreign": "The native module of Halfspace that is installed is not for ",
    "broken": "The native module of Halfspace cannot be loaded on ",
    "other version": "Halfspace 0.1.0 found its native module in version 9.9.9: ",
    "old processor": "Halfspace needs a processor with SSE4.2, as Blender does, and this one does not have it",
}
"""Beginning of the sentence by the fault."""

MODEL = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the package's source, and a model in it."""
    folder = tmp_path_factory.mktemp("staged")
    package_python.stage(folder)
    (folder / "model.ply").write_text(MODEL, encoding="utf-8")
    return folder


def python(staged: Path, shadow: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A Python that finds the modules of `shadow` before all others, and the package."""
    search = {**os.environ, "PYTHONPATH": os.pathsep.join([str(shadow), str(staged)])}
    return subprocess.run([sys.executable, *words], cwd=staged, env=search, capture_output=True, text=True, check=False)


@pytest.fixture(params=FILES)
def fault(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """The name of a fault, whose files lie in tmp_path."""
    for name, text in FILES[request.param].items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return str(request.param)


def test_a_command_reports_the_fault_in_one_line(fault: str, staged: Path, tmp_path: Path) -> None:
    done = python(staged, tmp_path, "-m", "halfspace", "bench", "model.ply")
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.startswith(f"bench: {SENTENCES[fault]}")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "code",
    [
        "halfspace.build([], [])",
        "from halfspace import Hits",
        "from halfspace import *",
        "halfspace.load('model.ply')",
        "halfspace.measure(None, 'kd')",
        "import halfspace.bvhtree",
        "import halfspace.trimesh",
        "import halfspace.open3d",
    ],
)
def test_each_use_of_the_module_raises_one_import_error(code: str, staged: Path, tmp_path: Path) -> None:
    (tmp_path / "halfspace_native.py").write_text(ABSENT, encoding="utf-8")
    done = python(staged, tmp_path, "-c", f"import halfspace\nprint(halfspace.__version__)\n{code}\n")
    assert (done.returncode, done.stdout) == (1, "0.1.0\n"), done.stderr
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: {SENTENCES['absent']}")
    assert done.stderr.count("Traceback") == 1


def test_the_error_states_the_fault(fault: str, staged: Path, tmp_path: Path) -> None:
    code = "import halfspace\ntry:\n    halfspace.build([], [])\n"
    code += "except ImportError as error:\n    print(error.name, error)\n"
    done = python(staged, tmp_path, "-c", code)
    assert done.stdout.startswith(f"halfspace_native {SENTENCES[fault]}"), done.stderr
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in launcher.COMMANDS)])
def test_help_needs_no_module(words: list[str], staged: Path, tmp_path: Path) -> None:
    (tmp_path / "halfspace_native.py").write_text(DEADLY, encoding="utf-8")
    done = python(staged, tmp_path, "-m", "halfspace", *words)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


@pytest.mark.parametrize(("files", "line"), [("absent", "native module: The native module of Halfspace is"), ("", "")])
def test_the_version_names_the_module_and_the_licence(files: str, line: str, staged: Path, tmp_path: Path) -> None:
    for name, text in FILES.get(files, {}).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    done = python(staged, tmp_path, "-m", "halfspace", "--version")
    assert (done.returncode, done.stderr) == (0, "")
    first, module, licence = done.stdout.splitlines()
    assert (first, licence) == (f"halfspace {native.VERSION}", "licence GPL-3.0-or-later")
    assert module.startswith(
        line or f"native module {native.VERSION}: {halfspace_native.level()} in use on this machine"
    )


def test_names_are_listed_without_the_module_and_others_are_unknown(staged: Path, tmp_path: Path) -> None:
    (tmp_path / "halfspace_native.py").write_text(DEADLY, encoding="utf-8")
    code = "import halfspace\nprint({*halfspace.__all__} <= {*dir(halfspace)}, hasattr(halfspace, 'oak'))\n"
    done = python(staged, tmp_path, "-c", code)
    assert (done.returncode, done.stdout) == (0, "True False\n"), done.stderr


def test_another_project_of_the_name_is_reported(tmp_path: Path) -> None:
    package_python.stage(tmp_path)
    (tmp_path / "halfspace" / "__init__.py").write_text("from . import core\n", encoding="utf-8")
    for words in (["bench", "model.ply"], ["--help"]):
        done = python(tmp_path, tmp_path, "-m", "halfspace", *words)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("halfspace: files of another project named halfspace replace some of ")
        assert done.stderr.count("\n") == 1
