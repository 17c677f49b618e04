# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python package: `python scripts/package_python.py [--website URL] [--out DIR]`.

Makes a wheel and a source archive of what works without a Blender window: `addon/core` and `addon/blender`, the
laboratory, and the commands of `scripts/`, around the few files of `distribution/`. They are the same modules; only
the names of the packages in their imports change, since an installed package must not take the names `addon` and
`lab`. The compiled module is a wheel of its own, which `scripts/package.py` builds. --website enters the page of the
publisher into the metadata.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.core.base import command
from lab.base.usage import Parser, output, website

ROOT = Path(__file__).resolve().parents[1]

PACKAGE = "halfspace"

FOLDERS = {"addon/core": "core", "addon/blender": "blender", "lab": "lab", "docs/lessons": "docs/lessons"}
"""Folder of the package by folder of the repository."""

FILES = {"native/python/halfspace_native.pyi": "../halfspace_native-stubs/__init__.pyi", "docs/manual.md": "manual.md"}
"""Place in the package by single file of the repository. The stub serves type checkers as PEP 561 prescribes."""

COMMANDS = ("bench", "choose", "claims", "compare", "export", "growth", "inspector", "lessons", "render", "stability")
"""The scripts that become commands."""

SEARCH_PATH = "sys.path.insert(0, str(Path(__file__).resolve().parents[1]))\n"
"""The line with which a script finds the repository; the installed package is found without."""

RENAMED = (
    (re.compile(r"^(\s*)import addon$", re.MULTILINE), r"\1import halfspace as addon"),
    (re.compile(r"^(\s*)from addon\.(?=core|blender)", re.MULTILINE), r"\1from halfspace."),
    (re.compile(r"^(\s*)from lab(?=[. ])", re.MULTILINE), r"\1from halfspace.lab"),
)
"""Patterns of imports from the repository's packages, and their replacements."""


class DistributionError(RuntimeError):
    """The package cannot be built. The message states why."""


def renamed(text: str) -> str:
    """A module's text with the imports of the package."""
    for pattern, replacement in RENAMED:
        text = pattern.sub(replacement, text)
    return text


def stage(folder: Path, website: str | None = None) -> None:
    """Fill an empty folder with the source of the package. Raises DistributionError.

    website: the address of the publisher's page, entered if given.
    """
    shutil.copytree(ROOT / "distribution", folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy2(ROOT / "LICENSE", folder)
    if website is not None:
        with (folder / "pyproject.toml").open("a", encoding="utf-8") as file:
            file.write(f'\n[project.urls]\nHomepage = "{website}"\nDocumentation = "{website}"\n')
    package = folder / PACKAGE
    for source, target in FOLDERS.items():
        shutil.copytree(ROOT / source, package / target, ignore=shutil.ignore_patterns("__pycache__", "*.pyc", ".*"))
    for source, target in FILES.items():
        (package / target).parent.mkdir(exist_ok=True)
        shutil.copy2(ROOT / source, package / target)
    # The scripts become modules, found without a search path.
    (package / "commands").mkdir()
    (package / "commands" / "__init__.py").write_text('"""The commands, one module each."""\n', encoding="utf-8")
    for name in COMMANDS:
        text = (ROOT / "scripts" / f"{name}.py").read_text(encoding="utf-8")
        if SEARCH_PATH not in text:
            raise DistributionError(f"scripts/{name}.py: the line that finds the repository is not the known one")
        (package / "commands" / f"{name}.py").write_text(text.replace(SEARCH_PATH, ""), encoding="utf-8")
    for path in package.rglob("*.py"):
        path.write_text(renamed(path.read_text(encoding="utf-8")), encoding="utf-8")


def build(out: Path, website: str | None = None) -> list[Path]:
    """Build the wheel and the source archive into the folder `out`. Returns both. Raises DistributionError.

    website: as for `stage`.
    """
    try:
        from hatchling import build as backend
    except ImportError as error:
        raise DistributionError("hatchling is not installed: set up the environment with scripts/test.py") from error
    out = out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="distribution-") as name:
        stage(Path(name), website)
        # A build backend works on the current folder (PEP 517).
        with contextlib.chdir(name):
            return [out / backend.build_wheel(str(out)), out / backend.build_sdist(str(out))]


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="package_python", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--website", type=website, metavar="URL", help="the publisher's page, for the metadata")
    parser.add_argument("--out", type=output, default=ROOT / "build" / "python", help="default: build/python")
    return command.run("package_python", arguments, parser.parse_args, run, told=(DistributionError,))


def run(asked: argparse.Namespace) -> int:
    """Build with these arguments. Returns the exit status."""
    for path in build(asked.out, asked.website):
        print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
