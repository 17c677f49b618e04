# SPDX-License-Identifier: GPL-3.0-or-later
"""Zips of the extension, and a Blender that installs them into an empty user folder in a process of its own."""

import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts import package

INSIDE = Path(__file__).resolve().parent / "installing" / "inside"
"""The folder that such a Blender runs."""


def built_wheel() -> Path:
    """The wheel that the environment was set up with."""
    wheels = sorted((package.ROOT / "build" / "wheel").glob("*.whl"))
    assert len(wheels) == 1, "scripts/test.py builds the wheel first"
    return wheels[0]


def other_build(wheel: Path, folder: Path, mark: str) -> Path:
    """A wheel of the same name and version, whose package has the attribute BUILD with the text `mark`."""
    made = folder / wheel.name
    with zipfile.ZipFile(wheel) as source, zipfile.ZipFile(made, "w") as target:
        for entry in source.infolist():
            content = source.read(entry)
            if entry.filename == "halfspace_native/__init__.py":
                content += f"\nBUILD = {mark!r}\n".encode()
            target.writestr(entry, content)
    return made


def for_system(folder: Path, tag: str) -> Path:
    """A wheel for another system, without content."""
    made = folder / f"halfspace_native-0.1.0-cp311-abi3-{tag}.whl"
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("halfspace_native/__init__.py", "")
        archive.writestr("halfspace_native-0.1.0.dist-info/METADATA", "Name: halfspace_native\nVersion: 0.1.0\n")
        archive.writestr("halfspace_native-0.1.0.dist-info/WHEEL", "Root-Is-Purelib: false\n")
        archive.writestr("halfspace_native-0.1.0.dist-info/RECORD", "halfspace_native/__init__.py,,\n")
    return made


def made_zip(folder: Path, name: str, wheel: Path, changes: Mapping[str, Callable[[str], str]] | None = None) -> Path:
    """A zip by the functions of scripts/package.py. changes: what becomes of the text of a file, by its path inside."""
    staged = folder / f"{name}-staged"
    package.stage([wheel], staged)
    for path, change in (changes or {}).items():
        before = (staged / path).read_text(encoding="utf-8")
        after = change(before)
        assert after != before, f"{path} does not contain what was to be changed"
        (staged / path).write_text(after, encoding="utf-8")
    made = folder / f"{name}.zip"
    package.run_tool("build", "--source-dir", str(staged), "--output-filepath", str(made))
    return made


def session(user: Path, steps: str, *arguments: str, before: Sequence[str] = ()) -> dict[str, Any]:
    """Findings of a user's Blender in a scenario of these steps, a module of INSIDE, and its whole output as "log".

    user: its folder for settings and extensions. before: a command that runs it.
    """
    # Nothing of this environment but bpy: no PYTHONPATH, no current folder, no user site.
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "BLENDER_"))}
    done = subprocess.run(
        [*before, sys.executable, "-I", str(INSIDE), steps, *arguments],
        env={**clean, "BLENDER_USER_RESOURCES": str(user)},
        cwd=user,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("FOUND ")]
    assert done.returncode == 0, done.stdout + done.stderr
    assert lines, done.stdout + done.stderr
    return {**json.loads(lines[0].removeprefix("FOUND ")), "user": str(user), "log": done.stdout + done.stderr}
