# SPDX-License-Identifier: GPL-3.0-or-later
"""The systems for which there are wheels: how the compiler calls each, and what links and runs its programs here."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

BLENDER_GLIBC = (2, 28)
"""The oldest glibc on which Blender itself runs on Linux, by its published requirements."""

FRAMEWORKS = Path(__file__).resolve().parent / "frameworks"
"""Stubs of those of Apple's frameworks that the native module loads, for linkers without Apple's SDK.

They state where macOS has the frameworks, and list none of their names: the module looks up all names at run time.
"""


class TargetError(RuntimeError):
    """Programs for a system cannot be built or run on this machine. The message names what to install."""


@dataclass(frozen=True)
class Target:
    """A system by Blender's name of it, and the compiler's.

    compiler: the C compiler that links its programs; empty where zig is the only one. runner: the program that runs
    its programs on Linux, with arguments; empty where there is none. packages: Debian's packages with both. share: the
    tests trace one ray of this many on hard scenes, because the runner emulates the processor.
    """

    name: str
    triple: str
    compiler: str = ""
    runner: str = ""
    packages: str = ""
    variables: dict[str, str] = field(default_factory=dict)
    share: int = 1

    @property
    def is_here(self) -> bool:
        """Whether it is the system that this Python runs on."""
        return self.name == here()


TARGETS = {
    target.name: target
    for target in (
        Target("linux-x64", "x86_64-unknown-linux-gnu", "cc"),
        Target(
            "linux-arm64",
            "aarch64-unknown-linux-gnu",
            "aarch64-linux-gnu-gcc",
            "qemu-aarch64 -L /usr/aarch64-linux-gnu",
            "gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user",
            share=11,
        ),
        Target(
            "windows-x64",
            "x86_64-pc-windows-gnu",
            "x86_64-w64-mingw32-gcc",
            "wine",
            "gcc-mingw-w64-x86-64 wine64 wine",
            {"WINEDEBUG": "-all"},
        ),
        Target("windows-arm64", "aarch64-pc-windows-gnullvm"),
        Target("macos-arm64", "aarch64-apple-darwin"),
        Target("macos-x64", "x86_64-apple-darwin"),
    )
}
"""Blender's name of each system with a wheel to the system."""


def here() -> str:
    """Blender's name of the system that this Python runs on, such as "linux-x64"."""
    system = {"win32": "windows", "darwin": "macos"}.get(sys.platform, sys.platform)
    machine = platform.machine().lower()
    return f"{system}-" + {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64"}.get(machine, machine)


def program(target: Target, name: str) -> str:
    """The path of a program that builds or runs for a system. Raises TargetError."""
    found = shutil.which(name)
    if found is None:
        source = f"Debian's packages {target.packages}" if target.packages else "the system's packages"
        raise TargetError(f"{name}, which {target.name} needs, is not on the PATH: install {source}")
    return found


def output(target: Target, *words: str) -> str:
    """The output of a compiler for a system; empty if it fails. Raises TargetError."""
    done = subprocess.run([program(target, words[0]), *words[1:]], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def variables(target: Target, *, run: bool = False) -> dict[str, str]:
    """The environment in which cargo compiles for a system, and with `run` also runs. Raises TargetError."""
    folder = output(target, "rustc", "--target", target.triple, "--print", "target-libdir")
    if not folder or not list(Path(folder).glob("libstd-*")):
        raise TargetError(
            f"Rust's standard library for {target.name} is not installed: run `rustup target add {target.triple}`, "
            "or install the system's package of it"
        )
    if target.is_here:
        return {}
    prefix = "CARGO_TARGET_" + target.triple.upper().replace("-", "_")
    found = {f"{prefix}_LINKER": program(target, target.compiler)} if target.compiler else {}
    if run:
        if not target.runner:
            raise TargetError(f"programs for {target.name} run only on that system")
        runner, *options = target.runner.split()
        found |= {**target.variables, f"{prefix}_RUNNER": " ".join([program(target, runner), *options])}
    return found


def maturin(target: Target, python: Path) -> tuple[list[str], dict[str, str]]:
    """The options and the environment of maturin for a wheel that runs wherever Blender does. Raises TargetError.

    The wheel is for the stable interface of all versions of Python: no interpreter of that system is needed. python:
    the interpreter of an environment with zig.
    """
    found = variables(target)
    options = [] if target.is_here and "linux" not in target.triple else ["--target", target.triple]
    if "linux" in target.triple:
        # By default zig links its own unwinder. The C library ends threads with the system's, and the two crash on each
        # other's records when Python, at exit, ends a thread that waits for it.
        unwinder = output(target, target.compiler, "-print-file-name=libgcc_s.so.1")
        if not Path(unwinder).is_absolute():  # the compiler prints the bare name if it does not find the file
            raise TargetError(f"{target.compiler} finds no libgcc_s.so.1: install gcc (the system's packages) first")
        # With the name of the compatibility, maturin fails where a symbol is newer.
        name = "manylinux_{}_{}".format(*BLENDER_GLIBC)
        options += ["--zig", "--compatibility", name, "--", f"-Clink-arg={Path(unwinder).resolve()}"]
    elif not target.compiler and not target.is_here:
        options += ["--zig", *(["--", f"-Clink-arg=-F{FRAMEWORKS}"] if "apple" in target.triple else [])]
    if "--zig" in options:
        # A linker named in the environment would come before zig, which the PATH need not contain.
        found = {"CARGO_ZIGBUILD_PYTHON_PATH": str(python)}
    return options, found
