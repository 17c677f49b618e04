# SPDX-License-Identifier: GPL-3.0-or-later
"""The native wheel: built when its sources changed, and only then."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
from pathlib import Path

NOT_IN_THE_WHEEL = {"target", "tests", "benches", "examples", "fuzz", "__pycache__"}
"""Names of folders, in every crate of the workspace, whose changes do not change the wheel."""


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
        # With the length, two files cannot give the same bytes as one.
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def sources(root: Path) -> list[Path]:
    """The files that the wheel is made from, sorted."""
    found = [root / ".cargo" / "config.toml", root / "LICENSE"]
    for folder, inside, files in os.walk(root / "native"):
        # Removed here, these folders are not entered.
        inside[:] = sorted(set(inside) - NOT_IN_THE_WHEEL)
        found += [Path(folder, name) for name in sorted(files)]
    kinds = {".rs", ".toml", ".lock", ".pyi", ".py"}
    return [path for path in found if path.is_file() and (path.suffix in kinds or path.name == "LICENSE")]


def unwinder() -> Path:
    """The path of the library that unwinds stacks on Linux, as the system's compiler finds it. Raises BuildError."""
    name = "libgcc_s.so.1"
    if shutil.which("cc") is None:
        raise BuildError("cc is not on the PATH: install gcc (the system's packages) first")
    done = subprocess.run(["cc", f"-print-file-name={name}"], capture_output=True, text=True, check=False)
    found = Path(done.stdout.strip())
    if not found.is_absolute():  # cc prints the bare name if it does not find the file
        raise BuildError(f"cc finds no {name}: install gcc (the system's packages) first")
    return found.resolve()


def build(root: Path, python: Path, *, glibc: tuple[int, int] | None = None) -> tuple[Path, bool]:
    """The wheel in its folder below build, and whether it was built now. Raises BuildError.

    python: an interpreter whose environment has maturin, and zig if `glibc` is given. glibc: on Linux, the oldest
    version of the C library with which the wheel must run; None: that of this machine.
    """
    folder = root / "build" / "wheel"
    options, variables = ["--interpreter", str(python)], {"PYO3_PYTHON": str(python)}
    if glibc is not None:
        name = "manylinux_{}_{}".format(*glibc)
        folder = folder.with_name(f"wheel-{name}")
        options += ["--zig", "--compatibility", name]  # it fails where a symbol is newer
        # By default zig links its own unwinder. The C library ends threads with the system's, and the two crash on each
        # other's records when Python, at exit, ends a thread that waits for it.
        options += ["--", f"-Clink-arg={unwinder()}"]
        # Otherwise looked up on the PATH, which need not contain the environment.
        variables["CARGO_ZIGBUILD_PYTHON_PATH"] = str(python)
    stamp = folder / "fingerprint"
    wanted = fingerprint(root)
    found = sorted(folder.glob("*.whl"))
    if len(found) == 1 and stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return found[0], False
    if shutil.which("cargo") is None:
        raise BuildError("cargo is not on the PATH: install Rust (rustup or the system's packages) first")
    # A fresh folder replaces the old one only after success.
    fresh = folder.with_name(folder.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    done = subprocess.run(
        [str(python), "-m", "maturin", "build", "--release", "--out", str(fresh), *options],
        cwd=root,
        env={**os.environ, **variables},
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
