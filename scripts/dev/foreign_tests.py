# SPDX-License-Identifier: GPL-3.0-or-later
"""Run trimesh's own ray tests, unchanged, on our intersector: `python scripts/dev/foreign_tests.py PATH`.

PATH is a checkout or an unpacked source archive of trimesh with its folders `trimesh`, `tests` and `models`; what these
import (such as scipy and networkx) must be installed. Where trimesh would load its module for Embree it gets
`halfspace.trimesh`. The exit status is that of pytest.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addon.core.base import command
from lab.base.usage import Parser

ROOT = Path(__file__).resolve().parents[2]

INTERSECTOR = ROOT / "distribution" / "halfspace" / "trimesh.py"

TESTS = ("test_ray.py", "test_ray_upstream.py")
"""The files of trimesh's tests about rays; those that a version lacks are left out."""


class NoTestsError(RuntimeError):
    """The folder holds no tests of trimesh. The message names it."""


def module(name: str) -> ModuleType:
    """Our intersector under the given name of a module."""
    spec = importlib.util.spec_from_file_location(name, INTERSECTOR)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[name] = made
    spec.loader.exec_module(made)
    return made


def run(asked: argparse.Namespace) -> int:
    """Run the tests. Returns pytest's exit status. Raises NoTestsError."""
    import pytest

    folder = asked.path.resolve()
    files = [str(path) for path in (folder / "tests" / name for name in TESTS) if path.is_file()]
    if not files or not (folder / "trimesh").is_dir():
        raise NoTestsError(f"{folder} holds no trimesh with tests of rays")
    sys.path[:0] = [str(folder), str(folder / "tests")]
    # Stand in for the module that trimesh.ray imports.
    module("trimesh.ray.ray_pyembree")
    with contextlib.chdir(folder / "tests"):
        return int(
            pytest.main(["--rootdir", str(folder), "-c", "/dev/null", "-p", "no:cacheprovider", *files, *asked.pytest])
        )


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="foreign_tests", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("path", type=Path, help="folder of trimesh's sources")
    parser.add_argument("pytest", nargs="*", help="arguments for pytest")
    return command.run("foreign_tests", arguments, parser.parse_args, run, told=(NoTestsError,))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
