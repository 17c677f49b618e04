# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `halfspace`: `halfspace COMMAND [options]`.

Exit status: that of the command; 2 for an unknown one, and if another project has overwritten the package; 0 for --help
and --version.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence

COMMANDS = {
    "bench": "error and run time of acceleration structures, side by side",
    "choose": "the structure that is quickest for a scene, measured",
    "claims": "claims of papers about their structures, measured again",
    "compare": "pictures of Halfspace and of Cycles (needs Blender)",
    "export": "a whole tree as a NumPy archive",
    "growth": "how building and tracing grow with the number of triangles",
    "inspector": "a page of maps, worst rays, trees and levels of structures",
    "lessons": "five scenes for a class as .blend files, with questions and answers (needs Blender)",
    "render": "a picture without a window",
    "stability": "answers on random and extreme scenes against brute force",
}
"""Command to what it does. Each is a module in `commands`, with a function `main`."""

USAGE = "usage: halfspace COMMAND [options]\n\n" + "".join(f"  {name:<10} {text}\n" for name, text in COMMANDS.items())

OVERWRITTEN = (
    "halfspace: files of another project named halfspace replace some of the package halfspace-rt: "
    "uninstall both, then install halfspace-rt again"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command. Returns the exit status."""
    if not hasattr(sys.modules[__package__], "measure"):
        # The project `halfspace` of PyPI installs a module of the same name.
        print(OVERWRITTEN, file=sys.stderr)
        return 2
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        print(USAGE + "\n`halfspace COMMAND --help` lists the options of a command.")
        return 0 if given else 2
    if given[0] == "--version":
        from .core.base.native import VERSION

        print(f"halfspace {VERSION}")
        return 0
    if given[0] not in COMMANDS:
        print(f"halfspace: unknown command {given[0]!r}; expected one of {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    status: int = importlib.import_module(f".commands.{given[0]}", __package__).main(given[1:])
    if "bpy" in sys.modules:
        # Blender 4.5 as a module hangs at the interpreter's end after a render.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


if __name__ == "__main__":
    sys.exit(main())
