# SPDX-License-Identifier: GPL-3.0-or-later
"""The native wheel: built when its sources changed, and only then."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
from pathlib import Path

NOT_IN_THE_WHEEL = {"target", "tests", "benches", "fuzz", "__pycache__"}
"""Folders of the crate whose changes do not change the wheel."""


class BuildError(RuntimeError):
    """The wheel could not be built. The message ends with the compiler's last lines."""


def fingerprint(root: Path) -> str:
    """A hash of everything that the wheel is made from; equal as long as the wheel need not be built again."""
    import tomllib

    digest = hashlib.sha256()
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    parts = [project.get("build-system"), project.get("project"), project.get("tool", {}).get("maturin")]
    digest.update(json.dumps(parts, sort_keys=True).encode())
    for path in sources(root):
        # The length keeps two files from reading as one.
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def sources(root: Path) -> list[Path]:
    """The files that the wheel is made from, sorted."""
    native = root / "native"
    inside = [
        path
        for top in sorted(native.iterdir())
        if top.name not in NOT_IN_THE_WHEEL
        for path in ([top] if top.is_file() else sorted(top.rglob("*")))
        if path.suffix in {".rs", ".toml", ".lock", ".pyi"}
    ]
    return [path for path in (root / ".cargo" / "config.toml", root / "LICENSE", *inside) if path.is_file()]


def build(root: Path, python: Path) -> tuple[Path, bool]:
    """The wheel for this machine in build/wheel, and whether it had to be built. Raises BuildError.

    python: an interpreter whose environment has maturin.
    """
    folder = root / "build" / "wheel"
    stamp = folder / "fingerprint"
    wanted = fingerprint(root)
    found = sorted(folder.glob("*.whl"))
    if len(found) == 1 and stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return found[0], False
    if shutil.which("cargo") is None:
        raise BuildError("cargo is not on the PATH: install Rust (rustup or the system's packages) first")
    # Into a fresh folder that takes the old one's place only when all went well.
    fresh = root / "build" / "wheel.new"
    shutil.rmtree(fresh, ignore_errors=True)
    command = [str(python), "-m", "maturin", "build", "--release", "--out", str(fresh), "--interpreter"]
    done = subprocess.run(
        [*command, str(python)],
        cwd=root,
        env={**os.environ, "PYO3_PYTHON": str(python)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise BuildError(
            "the native module does not build:\n" + "\n".join((done.stderr or done.stdout).splitlines()[-40:])
        )
    wheels = sorted(fresh.glob("*.whl"))
    if len(wheels) != 1:
        raise BuildError(f"expected one wheel from maturin, got {len(wheels)}")
    (fresh / "fingerprint").write_text(wanted, encoding="utf-8")
    shutil.rmtree(folder, ignore_errors=True)
    fresh.rename(folder)
    return folder / wheels[0].name, True
