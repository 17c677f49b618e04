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


LEVELS = ("fallback", "sse4.2", "avx2", "avx512", "neon")
"""The instruction sets for which a native module may hold code."""


def version() -> list[str]:
    """The lines of --version: version and commit of a clone, instruction sets of the native module here, licence."""
    from ...core.base import native
    from ..base.places import ROOT
    from ..report import history

    # A repository around an installed package is another project's.
    found = history.commit(ROOT) if (ROOT / "native" / "Cargo.toml").is_file() else ""
    lines = [f"halfspace {native.VERSION}" + (f", commit {found}" if found else "")]
    try:
        module = native.load()
    except native.NativeError as error:
        lines.append(f"native module: {error}")
    else:
        # This process ends after the answer, so the chosen level does not matter.
        best, others = module.level(), []
        for name in LEVELS:
            try:
                module.use_level(name)
            except ValueError:
                continue
            others += [name] if name != best else []
        more = f"; also {', '.join(others)}" if others else ""
        lines.append(f"native module {module.__version__}: {best} in use on this machine{more}")
    return [*lines, "licence GPL-3.0-or-later"]


def main(arguments: Sequence[str], prepare: Callable[[str], None] = lambda _: None) -> int:
    """Run a command. Returns the exit status; where the command loaded Blender as a module, ends the process instead.

    prepare: called with the name of the command before anything of the package is loaded for it.
    """
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE + "\n`halfspace COMMAND --help` lists the options of a command.")
        return 0 if arguments else 2
    if arguments[0] == "--version":
        print("\n".join(version()))
        return 0
    name = arguments[0]
    if name not in COMMANDS:
        from ...core.base.notes import meant

        known = f"expected one of {', '.join(COMMANDS)}{meant(name, COMMANDS)}"
        print(f"halfspace: unknown command {name!r}; {known}", file=sys.stderr)
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
