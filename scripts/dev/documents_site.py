# SPDX-License-Identifier: GPL-3.0-or-later
"""The documents as a site: `python -m scripts.dev.documents_site [--no-pictures] [--history FILE] [--out DIR]`.

Stages docs/, README and CHANGELOG in a temporary folder, adds a page for each structure and each notebook, which is
run, and the reference of the Python package, and builds all with Zensical, whose warnings are errors. A file of `bench
--history` becomes a page. Pictures of structures that build/pictures lacks are drawn first, which takes minutes and
needs Blender 5.2 or newer. Exit status: 0 built; 2 bad usage, or a warning, with Zensical's last lines; 130 stopped.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from addon.core.base import command, native
from addon.lab.base.usage import Parser, output
from addon.lab.report import history
from scripts import package_python
from scripts.dev import structure_pages

ROOT = Path(__file__).resolve().parents[2]

PICTURES = ROOT / "build" / "pictures"
"""Drawn pictures of structures, `ID.jpg`."""

OUTSIDE = {"README.md": "readme.md", "CHANGELOG.md": "changelog.md"}
"""Documents outside of docs/ to their names in the site."""

LINK = re.compile(r"(\]\()([^)\s]+)(\))")

REFERENCE: dict[str, str] = {
    "halfspace": "    options:\n"
    "      members: [load, expand, measure, agrees, table, Options, Workload, View, register, unregister]\n",
    "halfspace.trimesh": "",
    "halfspace.open3d": "    options:\n      members: [RaycastingScene]\n",
    "halfspace.bvhtree": "    options:\n      members: [BVHTree]\n",
    "halfspace_native": "",
}
"""Public modules to the options of their reference, in the order of the page."""

REFERENCE_HEAD = """\
# Python reference

What `import halfspace` offers, its modules in place of the classes of other libraries, see [the Python
package](manual.md#the-python-package), and the module `halfspace_native`, on which all are built and which can be used
alone.
"""

NAVIGATION: dict[str, list[Any]] = {
    "Start": ["index.md", "readme.md", "changelog.md"],
    "Use": ["manual.md", "rendering.md", "pictures.md", "nodes.md", "benchmark.md", "trees.md", "platforms.md"],
    "Structures": ["structures.md", "structures/index.md"],
    "Lessons": [],
    "Read": ["results.md", "planes-or-boxes.md", "papers.md", "correctness.md"],
    "Develop": ["architecture.md", "from-a-paper.md", "reference.md"],
}
"""Parts of the site to their pages; lessons and pages of structures are added."""

PICTURE_SIZE, DEPTH = "640x400", "1-9"

DEPTHS = {"space": "9-13", "objects": "5-8", "octants": "1-5"}
"""Levels of a family at which its planes have the size of the scene's objects."""

SPEED = "speed.md"
"""The page of speeds by commit."""

LAST_LINES = 30


class SiteError(RuntimeError):
    """The site cannot be built. The message states why."""


def retargeted(text: str, place: str) -> str:
    """The text of a document with its links turned to the places of the staged files.

    place: the document's path from the root of the repository.
    """

    def changed(found: re.Match[str]) -> str:
        target, sharp, anchor = found[2].partition("#")
        if not target or ":" in target:
            return found[0]
        path = os.path.normpath((Path(place).parent / target).as_posix()).replace(os.sep, "/")
        at_home = OUTSIDE.get(place, place.removeprefix("docs/"))
        goal = OUTSIDE.get(path, path.removeprefix("docs/").replace(".pictures/", "pictures/"))
        goal = goal.replace(".ipynb", ".md")
        return f"{found[1]}{os.path.relpath(goal, Path(at_home).parent).replace(os.sep, '/')}{sharp}{anchor}{found[3]}"

    return LINK.sub(changed, text)


def reference() -> str:
    """The page of the reference, whose content mkdocstrings writes."""
    return "\n".join([REFERENCE_HEAD, *(f"::: {module}\n{options}" for module, options in REFERENCE.items())])


def stage(folder: Path, pictures: Path | None, package: Path) -> None:
    """Fill an empty folder with the pages of the site. Raises SiteError.

    pictures: the folder of those of structures, None for none. package: the source of the Python package, which
    notebooks import.
    """
    for path in sorted((ROOT / "docs").rglob("*")):
        target = folder / path.relative_to(ROOT / "docs")
        if path.suffix == ".md":
            target.parent.mkdir(parents=True, exist_ok=True)
            place = path.relative_to(ROOT).as_posix()
            target.write_text(retargeted(path.read_text(encoding="utf-8"), place), encoding="utf-8")
        elif path.is_file() and path.name != "mkdocs.yml":
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, target)
    for place, name in OUTSIDE.items():
        (folder / name).write_text(retargeted((ROOT / place).read_text(encoding="utf-8"), place), encoding="utf-8")
    for name in ("LICENSE", "CITATION.cff"):
        shutil.copy2(ROOT / name, folder)
    shutil.copytree(ROOT / ".pictures", folder / "pictures")
    (folder / "reference.md").write_text(reference(), encoding="utf-8")
    for path in sorted((folder / "lessons").glob("*.ipynb")):
        run_notebook(path, package)
    # Write the pages of structures, with the pictures that there are.
    module = native.load()
    scene = structure_pages.Scene(module)
    drawn = {path.stem: path for path in pictures.glob("*.jpg")} if pictures is not None else {}
    for path in drawn.values():
        shutil.copy2(path, folder / "pictures")
    rows = module.structures()
    (folder / "structures").mkdir()
    (folder / "structures" / "index.md").write_text(structure_pages.index(rows, drawn), encoding="utf-8")
    for row in rows:
        text = structure_pages.page(row, scene.cost(module, row["id"]), drawn)
        (folder / "structures" / f"{row['id']}.md").write_text(text, encoding="utf-8")


def stage_history(folder: Path, path: Path) -> None:
    """Add the page of speeds by commit, with its pictures. Raises SiteError."""
    try:
        text, pictures = history.page(history.read(path))
    except (history.HistoryError, OSError, UnicodeDecodeError) as error:
        raise SiteError(f"--history: {error}") from error
    (folder / SPEED).write_text(text, encoding="utf-8")
    for name, svg in pictures.items():
        (folder / "pictures" / name).write_text(svg, encoding="utf-8")


def run_notebook(path: Path, package: Path) -> None:
    """Run a notebook with nbconvert, which writes a page next to it, and its pictures. Raises SiteError.

    package: the folder from which cells import `halfspace`.
    """
    with tempfile.TemporaryDirectory(prefix="notebook-") as folder:
        # Cells may write into the folder of their notebook, IPython into its own.
        shutil.copy2(path, folder)
        words = ["--to", "markdown", "--execute", "--ExecutePreprocessor.timeout=300", "--output-dir", str(path.parent)]
        variables = {**os.environ, "PYTHONPATH": str(package), "IPYTHONDIR": folder}
        words = [sys.executable, "-m", "nbconvert", *words, path.name]
        done = subprocess.run(words, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        # IPython colours what an error says.
        last = re.sub(r"\x1b\[[\d;]*m", "", done.stderr).strip().splitlines()[-1]
        raise SiteError(f"{path.name}: {last}")
    # A link to the file itself is below the heading.
    page = path.with_suffix(".md")
    heading, _, rest = page.read_text(encoding="utf-8").partition("\n")
    offer = f'[Download this notebook]({path.name}){{ download="{path.name}" }}'
    note = f"{offer}. The results below are of the machine that built this page."
    page.write_text(f"{heading}\n\n{note}\n{rest}", encoding="utf-8")


def navigation(folder: Path) -> list[Any]:
    """The navigation of the staged pages: lessons and structures are those that there are."""
    lessons = sorted(path.relative_to(folder).as_posix() for path in (folder / "lessons").glob("*.md"))
    each = [f"structures/{row['id']}.md" for row in native.load().structures()]
    more: dict[str, list[Any]] = {"Lessons": lessons, "Structures": [{"One by one": each}]}
    more["Read"] = [SPEED] if (folder / SPEED).is_file() else []
    found = {name: [*pages, *more.get(name, ())] for name, pages in NAVIGATION.items()}
    return [{name: pages} for name, pages in found.items() if pages]


def build(out: Path, *, pictures: bool, speeds: Path | None = None) -> None:
    """Build the site as the folder `out`, which is replaced. pictures: with those of structures, drawn if missing.
    speeds: a file of speeds by commit.

    Raises SiteError and DistributionError.
    """
    if importlib.util.find_spec("zensical") is None:
        raise SiteError("Zensical is not installed: set up the environment with scripts/test.py")
    if pictures:
        draw()
    with tempfile.TemporaryDirectory(prefix="site-") as name:
        folder = Path(name)
        (folder / "docs").mkdir()
        package_python.stage(folder / "package")
        stage(folder / "docs", PICTURES if pictures else None, folder / "package")
        if speeds is not None:
            stage_history(folder / "docs", speeds)
        config = {
            "INHERIT": str(ROOT / "docs" / "mkdocs.yml"),
            "docs_dir": "docs",
            "site_dir": "site",
            "nav": navigation(folder / "docs"),
        }
        # YAML contains JSON.
        (folder / "mkdocs.yml").write_text(json.dumps(config), encoding="utf-8")
        words = [sys.executable, "-m", "zensical", "build", "--strict", "--config-file", "mkdocs.yml"]
        variables = {**os.environ, "HALFSPACE_PACKAGE": str(folder / "package"), "NO_COLOR": "1"}
        done = subprocess.run(words, cwd=folder, env=variables, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            # The findings come first, then where Zensical stopped because of them.
            said = re.sub(r"\x1b\[[\d;]*m", "", done.stdout + done.stderr).partition("Traceback")[0]
            raise SiteError("Zensical: " + "\n".join(said.splitlines()[-LAST_LINES:]))
        shutil.rmtree(out, ignore_errors=True)
        shutil.move(folder / "site", out)


def draw() -> None:
    """Draw the pictures of structures that are missing; brute force has the triangles alone. Raises SiteError."""
    from scripts.dev import overlay_picture

    PICTURES.mkdir(parents=True, exist_ok=True)
    for row in native.load().structures():
        path = PICTURES / f"{row['id']}.jpg"
        if path.is_file():
            continue
        options = ["--structure", row["id"], "--size", PICTURE_SIZE, "--depth", DEPTHS.get(row["family"], DEPTH)]
        style = ["--style", "OUTLINE"] if row["family"] == "octants" else []
        if overlay_picture.main([*options, *style, "--out", str(path)]):
            raise SiteError(f"the picture of {row['id']} cannot be drawn; --no-pictures builds the site without")


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="documents_site", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--no-pictures", action="store_true", help="without the pictures of structures")
    parser.add_argument("--history", type=Path, metavar="FILE", help="with the speeds of this file of bench --history")
    parser.add_argument("--out", type=output, default=ROOT / "build" / "site", help="default: build/site")
    told = (SiteError, package_python.DistributionError)
    return command.run("documents_site", arguments, parser.parse_args, run, told=told)


def run(asked: argparse.Namespace) -> int:
    """Build as the arguments say. Returns the exit status."""
    build(asked.out, pictures=not asked.no_pictures, speeds=asked.history)
    print(asked.out / "index.html")
    return 0


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)  # Blender as a module may hang at the interpreter's end
