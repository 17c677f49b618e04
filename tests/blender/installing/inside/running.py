# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts of the repository inside a Blender whose extension lies in a repository of another name."""

import contextlib
import io
import runpy
import sys
from pathlib import Path
from typing import Any

import bpy
from in_session import install, open_scene

REPOSITORY = "laboratory"


def run(archive: str, root: str, script: str, *arguments: str) -> dict[str, Any]:
    """Install the zip and run a script as Blender's --python does."""
    bpy.context.preferences.extensions.repos.new(name="Laboratory", module=REPOSITORY)
    found: dict[str, Any] = {"installed": install(archive, REPOSITORY) if archive else ""}
    open_scene()
    sys.argv = ["blender", "--", *arguments]
    out, errors = io.StringIO(), io.StringIO()
    found["status"] = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        try:
            runpy.run_path(str(Path(root) / "scripts" / f"{script}.py"), run_name="__main__")
        except SystemExit as end:
            found["status"] = end.code
    core = sys.modules.get("addon.core")
    theirs = [module for name, module in sys.modules.items() if name.endswith(f".{REPOSITORY}.halfspace.core")]
    found |= {
        "out": out.getvalue(),
        "errors": errors.getvalue(),
        "package": core and list(core.__path__),
        "same": core in theirs,
    }
    return found
