# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole acceleration structure as a NumPy archive: `halfspace export [SCENE] [options]`.

The archive holds nodes, planes, regions and leaves of the tree, and the triangles of the scene, as docs/trees.md
describes them. Exit status: 0 done; 2 bad usage or input, with the reason in one line, and an older archive stays; 130
stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ...core.base import command, native
from ...core.report import results
from ...core.structures import specs
from ..base.usage import Parser, UsageError, output
from ..bench import scenes
from ..export import trees

SIZE = 64, 64
"""Pixels of the view that comes with a scene of Blender; a tree does not depend on it."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="export", description=(__doc__ or "").splitlines()[0])
    made.add_argument(
        "scene",
        nargs="?",
        default="showcase",
        metavar="SCENE",
        help=f"{scenes.CHOICES} (default)",
    )
    made.add_argument("--structure", default="kd", metavar="SPEC", help="the configuration (default: kd)")
    made.add_argument("--out", type=output, required=True, metavar="FILE", help="the archive, .npz")
    made.add_argument("--threads", type=int, default=0, help="threads of the build, 0 = all (default: 0)")
    return made


def main(arguments: Sequence[str]) -> int:
    """Build and export. Returns the exit status."""
    return command.run("export", arguments, read, export)


def read(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line, checked before any work. Raises UsageError, SpecError, WorkloadError and FolderError."""
    asked = parser().parse_args(arguments)
    if asked.out.suffix.lower() != ".npz":
        raise UsageError(f"{asked.out}: expected a name that ends in .npz")
    if asked.out.is_dir():
        raise UsageError(f"{asked.out}: cannot be written: it is a folder")
    if not 0 <= asked.threads <= 1024:
        raise UsageError(f"--threads: expected 0 to 1024, got {asked.threads}")
    asked.structure = specs.canonical(native.load(), asked.structure)
    asked.load = scenes.loader(asked.scene, SIZE)
    results.prepare_folder(asked.out.parent)
    return asked


def export(asked: argparse.Namespace) -> int:
    """Load the scene, build the tree and write it. Returns the exit status. Raises what loading and building raise."""
    loaded = asked.load()
    for note in loaded.notes:
        print(f"[export] {note}")
    structure = native.load().build(loaded.vertices, loaded.triangles, asked.structure, threads=asked.threads)
    found = trees.arrays(structure, loaded.name, loaded.vertices, loaded.triangles)
    results.write_all({asked.out: trees.packed(found)})
    leaves = int((found["node_kind"] == trees.LEAF).sum())
    print(
        f"{asked.out}: {structure.spec} over {len(loaded.triangles):,} triangles of {loaded.name}: "
        f"{len(found['node_kind']) - leaves:,} inner nodes, {leaves:,} leaves"
    )
    return 0
