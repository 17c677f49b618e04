# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `halfspace COMMAND [options]`, in a clone `python scripts/halfspace.py COMMAND`.

Exit status: that of the command; 2 for an unknown one; 0 for --help and --version. Until a command is chosen, imports
only what Python has loaded by itself and this package, so that an interrupt ends it in one line.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Sequence

COMMANDS = {
    "bench": "error and run time of acceleration structures, side by side",
    "choose": "the structure that is quickest for a scene, measured",
    "claims": "claims of papers about their structures, measured again",
    "compare": "pictures of Halfspace and of Cycles (needs Blender)",
    "export": "a whole tree as a NumPy archive",
    "inspector": "a page of maps, worst rays, trees and levels of structures",
    "lessons": "five scenes for a class as .blend files, with questions and answers (needs Blender)",
    "render": "a picture without a window",
    "reported": "reported wrong answers of other ray tracers, theirs and ours",
    "stability": "answers on random and extreme scenes against brute force",
    "thesis": "the tables of Hoobergs 2019, measured again",
}
"""Command to what it does. Each is a module of this package."""

USAGE = "usage: halfspace COMMAND [options]\n\n" + "".join(f"  {name:<10} {text}\n" for name, text in COMMANDS.items())


def main(arguments: Sequence[str], prepare: Callable[[str], None] = lambda _: None) -> int:
    """Run a command. Returns the exit status; where the command loaded Blender as a module, ends the process instead.

    prepare: called with the name of the command before anything of the package is loaded for it.
    """
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE + "\n`halfspace COMMAND --help` lists the options of a command.")
        return 0 if arguments else 2
    if arguments[0] == "--version":
        from ...core.base.native import VERSION

        print(f"halfspace {VERSION}")
        return 0
    name = arguments[0]
    if name not in COMMANDS:
        print(f"halfspace: unknown command {name!r}; expected one of {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    # Load the command, guarded against interrupts, and run it.
    inside = "bpy" in sys.modules
    prepare(name)
    importlib.import_module("...core.base.interrupt", __package__).guard(name)
    status: int = importlib.import_module(f".{name}", __package__).main(arguments[1:])
    if "bpy" in sys.modules and not inside:
        # Blender 4.5 as a module hangs at the interpreter's end after a render.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status
