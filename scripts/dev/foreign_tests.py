# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the ray tests of trimesh or of Open3D, unchanged, on our classes: `python -m scripts.dev.foreign_tests PATH`.

PATH is a checkout or an unpacked source archive. trimesh: its folders `trimesh`, `tests` and `models`; what these
import (such as scipy and networkx) must be installed. Where trimesh would load its module for Embree it gets
`halfspace.trimesh`. Open3D: its folder `python/test`; Open3D itself must be installed, whose `RaycastingScene` is
replaced by `halfspace.open3d`. The exit status is that of pytest.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from addon.core.base import command
from addon.lab.base.usage import Parser

ROOT = Path(__file__).resolve().parents[2]

CLASSES = ROOT / "distribution" / "halfspace"
INTERSECTOR = CLASSES / "trimesh.py"

TESTS = ("test_ray.py", "test_ray_upstream.py")
"""The files of trimesh's tests about rays; those that a version lacks are left out."""


SCENE_TESTS = Path("python", "test", "t", "geometry", "test_raycasting_scene.py")
"""Open3D's tests of its class."""


class NoTestsError(RuntimeError):
    """The folder holds no tests of trimesh or Open3D, or Open3D is not installed. The message names it."""


def package() -> None:
    """Let `halfspace` be found in the folders from which scripts/package_python.py makes it, without its own names."""
    made = ModuleType("halfspace")
    made.__path__ = [str(CLASSES), str(ROOT / "addon")]
    sys.modules.setdefault(made.__name__, made)


def module(name: str, file: Path = INTERSECTOR) -> ModuleType:
    """The module of one of our classes, found under the given name too."""
    package()
    made = sys.modules[name] = importlib.import_module(f"halfspace.{file.stem}")
    return made


def run(asked: argparse.Namespace) -> int:
    """Run the tests. Returns pytest's exit status. Raises NoTestsError."""
    folder = asked.path.resolve()
    if (folder / SCENE_TESTS).is_file():
        return of_open3d(folder, asked.pytest)
    return of_trimesh(folder, asked.pytest)


def of_trimesh(folder: Path, arguments: Sequence[str]) -> int:
    """Run trimesh's tests of rays. Returns pytest's exit status. Raises NoTestsError."""
    files = [path for path in (folder / "tests" / name for name in TESTS) if path.is_file()]
    if not files or not (folder / "trimesh").is_dir():
        raise NoTestsError(f"{folder} holds no trimesh with tests of rays, and no Open3D")
    sys.path[:0] = [str(folder), str(folder / "tests")]
    # Stand in for the module that trimesh.ray imports.
    module("trimesh.ray.ray_pyembree")
    return pytest_status(folder, files, arguments)


def of_open3d(folder: Path, arguments: Sequence[str]) -> int:
    """Run Open3D's tests of RaycastingScene. Returns pytest's exit status. Raises NoTestsError."""
    try:
        import open3d
    except ImportError as error:
        raise NoTestsError(f"Open3D is not installed, whose tensors its tests use ({error})") from error
    # Stand in for the class that the tests look up.
    open3d.t.geometry.RaycastingScene = module("halfspace_open3d", CLASSES / "open3d.py").RaycastingScene
    return pytest_status(folder, [folder / SCENE_TESTS], arguments)


def pytest_status(folder: Path, files: Sequence[Path], arguments: Sequence[str]) -> int:
    """Run test files in their folder, without settings of ours or theirs. Returns pytest's exit status."""
    import pytest

    settings = ["--rootdir", str(folder), "-c", os.devnull, "-p", "no:cacheprovider"]
    with contextlib.chdir(files[0].parent):
        return int(pytest.main([*settings, *map(str, files), *arguments]))


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="foreign_tests", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("path", type=Path, help="folder of the sources of trimesh or Open3D")
    parser.add_argument("pytest", nargs="*", help="arguments for pytest")
    return command.run("foreign_tests", arguments, parser.parse_args, run, told=(NoTestsError,))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
