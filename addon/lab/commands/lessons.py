# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons of docs/lessons as .blend files, with questions and answers: `halfspace lessons [--out DIR] [--slides]`.

Needs Blender as a module. Exit status: 0 written; 2 bad usage, no Blender, or a file that cannot be written, with one
line; 130 stopped.
"""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Sequence

from ...core.base import command
from ...core.report import results
from ..base.places import OUT
from ..base.usage import NO_BLENDER, Parser, UsageError, output


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="lessons", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=output, default=OUT / "lessons", metavar="DIR", help="default: out/lessons")
    parser.add_argument("--slides", action="store_true", help="also write slides.html, a page of slides for a class")
    return command.run("lessons", arguments, parser.parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Write the files. Returns the exit status. Raises UsageError, FolderError, and Blender's RuntimeError."""
    if importlib.util.find_spec("bpy") is None:
        raise UsageError(NO_BLENDER)
    results.prepare_folder(asked.out)
    from ..lessons import files, lessons, slides

    for lesson in lessons.LESSONS:
        path = files.save(lesson, asked.out)
        print(f"{path} ({path.stat().st_size / 1e3:.0f} kB): {lesson.title}")
    if asked.slides:
        path = asked.out / "slides.html"
        print(f"{path}: {slides.write(path)} slides")
    return 0
