# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python package: built, installed into an empty environment, and used there."""

from __future__ import annotations

import importlib.metadata
import itertools
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.message import Message
from email.parser import Parser
from pathlib import Path

import numpy as np
import pytest
import trove_classifiers
from packaging.requirements import Requirement

from addon.core.base import native
from scripts import package_python
from scripts.dev import environment

pytestmark = pytest.mark.slow

ROOT = package_python.ROOT

PAGE = "https://example.org/halfspace"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The wheel and the source archive."""
    out = tmp_path_factory.mktemp("built")
    assert package_python.main(["--website", PAGE, "--out", str(out)]) == 0
    return [*out.glob("*.whl"), *out.glob("*.tar.gz")]


@pytest.fixture(scope="module")
def metadata(built: list[Path]) -> Message:
    with zipfile.ZipFile(built[0]) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return Parser().parsestr(archive.read(name).decode())


@pytest.fixture(scope="module")
def home(built: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the package, the native wheel and NumPy, and nothing else."""
    folder = tmp_path_factory.mktemp("home")
    wheels = sorted((ROOT / "build" / "wheel").glob("*.whl"))
    assert len(wheels) == 1, "scripts/test.py builds the wheel first"
    environment.uv(["venv", "--no-project", "--python", sys.executable, str(folder / "venv")], "no environment")
    numpy = f"numpy=={importlib.metadata.version('numpy')}"
    python = str(folder / "venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python"))
    environment.uv(["pip", "install", "--python", python, str(built[0]), str(wheels[0]), numpy], "not installed")
    side = np.linspace(0.0, 1.0, 20)
    corners = np.stack([*np.meshgrid(side, side), np.add.outer(side**2, side)], axis=-1).reshape(-1, 3)
    first = [20 * row + column for row in range(19) for column in range(19)]
    head = f"element vertex 400\nproperty float x\nproperty float y\nproperty float z\nelement face {len(first)}"
    lines = [" ".join(f"{value:.6f}" for value in corner) for corner in corners]
    lines += [f"4 {a} {a + 1} {a + 21} {a + 20}" for a in first]
    text = f"ply\nformat ascii 1.0\n{head}\nproperty list uchar int vertex_indices\nend_header\n" + "\n".join(lines)
    (folder / "model.ply").write_text(text + "\n", encoding="utf-8")
    return folder


def used(home: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A program of the environment, run in the folder of the model without anything of this environment."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    programs = home / "venv" / ("Scripts" if os.name == "nt" else "bin")
    return subprocess.run(
        [str(programs / words[0]), *words[1:]], cwd=home, env=clean, capture_output=True, text=True, check=False
    )


def test_a_benchmark_of_a_model_prints_its_two_tables(home: Path) -> None:
    options = ["--structures", "kd,bvh-sah", "--check-rays", "500", "--seconds", "2", "--curve", "none", "--only-rays"]
    done = used(home, "halfspace", "bench", "model.ply", *options)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "model: 722 triangles" in done.stdout
    for heading in ("One ray at a time", "As fast as it goes"):
        table = done.stdout.partition(heading)[2].splitlines()[3:]
        rows = list(itertools.takewhile(lambda row: row.startswith(("kd ", "bvh-sah ")), table))
        # A structure has several rows if each is the quickest for some rays.
        assert list(dict.fromkeys(row.split()[0] for row in rows)) == ["kd", "bvh-sah"], done.stdout
        assert all(row.endswith(" 0 0 0 0 0 0") for row in rows), "answers differ from brute force"


def test_a_model_is_rendered_without_blender(home: Path) -> None:
    done = used(home, "halfspace", "render", "model.ply", "--percentage", "5", "--samples", "1", "--out", "a.png")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "a.png: 96 × 54 pixels with kd, answers not compared\n"
    assert (home / "a.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["render"], "render: the built-in showcase: needs Blender"),
        (["lessons"], "lessons: needs Blender: the module bpy is not installed; the extra `blender` installs it"),
        (["render", "scene.blend"], "render: scene.blend: needs Blender"),
        (["bench", "scene.blend"], "bench: scene.blend: needs Blender"),
        (["render", "model.ply", "--structure", "oak"], "render: "),
        (["oak"], "halfspace: unknown command 'oak'; expected one of bench, choose"),
    ],
)
def test_rejects_wrong_command_lines_in_one_line(home: Path, words: list[str], says: str) -> None:
    (home / "scene.blend").touch()
    done = used(home, "halfspace", *words)
    assert done.returncode == 2
    assert done.stderr.startswith(says)
    assert done.stderr.count("\n") == 1, done.stderr


ALL = """
import importlib, pkgutil, sys
import halfspace

found = []
for one in pkgutil.walk_packages(halfspace.__path__, "halfspace."):
    if one.name.startswith("halfspace.blender") or one.name.endswith("__main__"):
        continue
    try:
        importlib.import_module(one.name)
        found.append(one.name)
    except ModuleNotFoundError as error:
        if error.name not in ("bpy", "mathutils"):
            raise
foreign = {"addon", "bpy"} & set(sys.modules)
print(len(found), sorted(foreign))
"""


def test_every_module_is_found_under_the_name_of_the_package(home: Path) -> None:
    done = used(home, "python", "-c", ALL)
    assert done.returncode == 0, done.stderr
    count, _, foreign = done.stdout.strip().partition(" ")
    assert int(count) > 100
    assert foreign == "[]"


USER = """
import halfspace

scene = halfspace.load("model.ply")
tree = halfspace.build(scene.vertices, scene.triangles, "kd")
size: int = tree.statistics["bytes"]
rows = halfspace.measure(scene, "kd", halfspace.Options(size=(64, 64), repeats=2))
text: str = halfspace.table(rows)
"""


def test_type_checkers_know_what_calls_return(home: Path) -> None:
    checker = [sys.executable, "-m", "mypy", "--strict", "--config-file", os.devnull, "--cache-dir", str(home / "mypy")]
    (home / "user.py").write_text(USER + 'wrong: str = tree.statistics["bytes"]\n', encoding="utf-8")
    python = home / "venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    words = [*checker, "--python-executable", str(python), "user.py"]
    done = subprocess.run(words, cwd=home, capture_output=True, text=True, check=False)
    errors = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert len(errors) == 1, done.stdout + done.stderr
    assert errors[0].startswith("user.py:9: error: Incompatible types in assignment")


def test_measuring_from_python_compares_the_answers(home: Path) -> None:
    code = USER + 'print(rows[0]["spec"], halfspace.agrees(rows[0]), size > 0, "kd" in text)\n'
    done = used(home, "python", "-c", code)
    assert done.stdout == "kd True True True\n", done.stderr


def test_the_metadata_is_whole(metadata: Message) -> None:
    assert (metadata["Name"], metadata["Version"]) == ("halfspace-rt", native.VERSION)
    assert (metadata["License-Expression"], metadata["License-File"]) == ("GPL-3.0-or-later", "LICENSE")
    assert metadata["Author"] == "The Halfspace authors"
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert str(metadata.get_payload()) == (ROOT / "distribution" / "README.md").read_text(encoding="utf-8")
    assert {"ray tracing", "kd-tree", "benchmark"} <= set(metadata["Keywords"].split(","))
    assert f"halfspace-native=={native.VERSION}" in metadata.get_all("Requires-Dist", [])
    assert "Typing :: Typed" in metadata.get_all("Classifier", [])


def test_the_page_of_the_publisher_is_entered_only_if_given(metadata: Message, tmp_path: Path) -> None:
    assert metadata.get_all("Project-URL") == [f"Homepage, {PAGE}", f"Documentation, {PAGE}"]
    package_python.stage(tmp_path)
    assert "urls" not in tomllib.loads((tmp_path / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.mark.parametrize("name", ["pyproject.toml", "distribution/pyproject.toml"])
def test_both_distributions_describe_themselves(name: str) -> None:
    project = tomllib.loads((ROOT / name).read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == ">=3.11", "the compiled module uses the stable interface of 3.11"
    assert set(project["classifiers"]) <= trove_classifiers.classifiers
    assert {"Programming Language :: Python :: 3.11", "Programming Language :: Rust"} <= set(project["classifiers"])
    assert (project["license"], project["license-files"]) == ("GPL-3.0-or-later", ["LICENSE"])
    assert all(project[key] for key in ("authors", "description", "keywords", "readme"))


@pytest.mark.parametrize(("python", "blender"), [("3.11", True), ("3.12", False), ("3.13", True), ("3.14", False)])
def test_extras_leave_out_what_a_python_cannot_have(metadata: Message, python: str, blender: bool) -> None:
    assert set(metadata.get_all("Provides-Extra", [])) == {"blender", "measure", "cluster"}
    needed: dict[str, set[str]] = {}
    for extra in ("", "blender", "measure", "cluster"):
        here = {"python_version": python, "python_full_version": f"{python}.0", "platform_machine": "x86_64"}
        lines = map(Requirement, metadata.get_all("Requires-Dist", []))
        needed[extra] = {one.name for one in lines if not one.marker or one.marker.evaluate({**here, "extra": extra})}
    base = {"halfspace-native", "numpy", "openimageio"}
    assert needed[""] == base
    assert needed["blender"] - base == ({"bpy"} if blender else set())
    assert needed["measure"] - base == {"embreex", "matplotlib"}
    assert needed["cluster"] - base == {"distributed"}


def test_both_archives_hold_the_same_and_nothing_of_this_machine(built: list[Path]) -> None:
    with zipfile.ZipFile(built[0]) as archive:
        wheel = {name: archive.read(name) for name in archive.namelist() if ".dist-info/" not in name}
    with tarfile.open(built[1]) as archive:
        top = f"halfspace_rt-{native.VERSION}/"
        members = {one.name.removeprefix(top): one for one in archive.getmembers() if one.isfile()}
        assert all(archive.extractfile(members[name]).read() == wheel[name] for name in wheel)  # type: ignore[union-attr]
    assert {"LICENSE", "README.md", "pyproject.toml"} <= members.keys()
    assert {"halfspace/py.typed", "halfspace/manual.md"} <= wheel.keys()
    homes = re.compile(rb"/(home|root|work|Users)/\w|" + re.escape(str(ROOT)).encode())
    assert [name for name, content in wheel.items() if homes.search(content)] == []
    assert [name for name in wheel if "__pycache__" in name or name.endswith(".pyc")] == []
