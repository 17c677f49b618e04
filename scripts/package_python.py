# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python package: `python scripts/package_python.py [--website URL] [--out DIR]`.

Makes a wheel and a source archive of what works without a Blender window: the package `addon`, which gets the name
`halfspace`, with the few files of `distribution/`. The compiled module is a wheel of its own, which
`scripts/package.py` builds. --website enters the page of the publisher into the metadata.
"""

from __future__ import annotations

import argparse
import contextlib
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.core.base import command
from addon.lab.base.usage import Parser, output, website

ROOT = Path(__file__).resolve().parents[1]

FOLDERS = {
    "distribution": "",
    **{f"addon/{room}": f"halfspace/{room}" for room in ("core", "blender", "lab")},
    "docs/lessons": "halfspace/docs/lessons",
}
"""Folder of the package's source by folder of the repository."""

FILES = {
    "LICENSE": "LICENSE",
    "docs/manual.md": "halfspace/manual.md",
}
"""The same for single files."""


class DistributionError(RuntimeError):
    """The package cannot be built. The message states why."""


def stage(folder: Path, website: str | None = None) -> None:
    """Copy the source of the package into an empty folder.

    website: the address of the publisher's page, entered if given.
    """
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
    for source, target in FOLDERS.items():
        shutil.copytree(ROOT / source, folder / target, dirs_exist_ok=True, ignore=ignored)
    for source, target in FILES.items():
        (folder / target).parent.mkdir(exist_ok=True)
        shutil.copy2(ROOT / source, folder / target)
    if website is not None:
        with (folder / "pyproject.toml").open("a", encoding="utf-8") as file:
            file.write(f'\n[project.urls]\nHomepage = "{website}"\nDocumentation = "{website}"\n')


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
