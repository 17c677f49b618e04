# SPDX-License-Identifier: GPL-3.0-or-later
"""The native wheel: built when its sources changed, and only then."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
from pathlib import Path

import targets
from targets import Target

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
    kinds = {".rs", ".toml", ".lock", ".pyi", ".py", ".md"}
    return [path for path in found if path.is_file() and (path.suffix in kinds or path.name == "LICENSE")]


def unwinder(compiler: str = "cc") -> Path:
    """The path of the library that unwinds stacks on Linux, as the compiler finds it. Raises BuildError."""
    name = "libgcc_s.so.1"
    if shutil.which(compiler) is None:
        raise BuildError(f"{compiler} is not on the PATH: install gcc (the system's packages) first")
    done = subprocess.run([compiler, f"-print-file-name={name}"], capture_output=True, text=True, check=False)
    found = Path(done.stdout.strip())
    if not found.is_absolute():  # the compiler prints the bare name if it does not find the file
        raise BuildError(f"{compiler} finds no {name}: install gcc (the system's packages) first")
    return found.resolve()


def arguments(
    python: Path, glibc: tuple[int, int] | None, target: Target | None
) -> tuple[str, list[str], dict[str, str]]:
    """The name of the wheel's folder, the options of maturin, and its environment. Raises BuildError, TargetError.

    The parameters are those of `build`.
    """
    variables = {"PYO3_PYTHON": str(python)}
    folder, options, compiler = "wheel", ["--interpreter", str(python)], "cc"
    if target is not None and not target.is_here:
        # The wheel is for the stable interface of all versions of Python: no interpreter of that system is needed.
        folder, options, compiler = f"wheel-{target.name}", ["--target", target.triple], target.compiler
        # Zig links for Linux; a linker named in the environment would come before it.
        variables |= {} if target.is_linux else targets.variables(target)
        targets.library(target)
    if target is not None and not target.is_linux:
        glibc = None
    if glibc is not None:
        name = "manylinux_{}_{}".format(*glibc)
        folder += f"-{name}"
        # With this name, maturin fails where a symbol is newer.
        # By default zig links its own unwinder. The C library ends threads with the system's, and the two crash on each
        # other's records when Python, at exit, ends a thread that waits for it.
        options += ["--zig", "--compatibility", name, "--", f"-Clink-arg={unwinder(compiler)}"]
    elif not compiler:
        options += ["--zig", "--", f"-Clink-arg=-F{targets.FRAMEWORKS}"]
    if "--zig" in options:
        # Otherwise looked up on the PATH, which need not contain the environment.
        variables["CARGO_ZIGBUILD_PYTHON_PATH"] = str(python)
    return folder, options, variables


def build(
    root: Path, python: Path, *, glibc: tuple[int, int] | None = None, target: Target | None = None
) -> tuple[Path, bool]:
    """The wheel in its folder below build, and whether it was built now. Raises BuildError or TargetError.

    python: an interpreter whose environment has maturin, and zig if `glibc` is given or `target` has no compiler of its
    own. glibc: on Linux, the oldest version of the C library with which the wheel must run; None: that of this machine.
    target: the system on which it must run; None: that of this machine.
    """
    name, options, variables = arguments(python, glibc, target)
    folder = root / "build" / name
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
