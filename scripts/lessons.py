# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons of docs/lessons as .blend files, with questions and answers: `python scripts/lessons.py [--out DIR]`.

Needs Blender as a module. Exit status: 0 written; 2 bad usage, no Blender, or a file that cannot be written, with one
line; 130 stopped.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.core.base import command
from addon.core.report import results
from lab.base.places import OUT
from lab.base.usage import Parser, UsageError, output


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="lessons", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=output, default=OUT / "lessons", metavar="DIR", help="default: out/lessons")
    return command.run("lessons", arguments, parser.parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Write the files. Returns the exit status. Raises UsageError, FolderError, and Blender's RuntimeError."""
    if importlib.util.find_spec("bpy") is None:
        raise UsageError("needs Blender: the module bpy is not installed; the extra `blender` installs it")
    results.prepare_folder(asked.out)
    from lab.lessons import files, lessons

    for lesson in lessons.LESSONS:
        path = files.save(lesson, asked.out)
        print(f"{path} ({path.stat().st_size / 1e3:.0f} kB): {lesson.title}")
    return 0


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)  # Blender as a module may hang at the interpreter's end
