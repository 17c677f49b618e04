# SPDX-License-Identifier: GPL-3.0-or-later
"""The systems for which there are wheels: how the compiler calls each, and what links and runs its programs here."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path


class TargetError(RuntimeError):
    """Programs for a system cannot be built or run on this machine. The message names what to install."""


FRAMEWORKS = Path(__file__).resolve().parents[1] / "systems" / "frameworks"
"""Stubs of those of Apple's frameworks that the native module loads, for linkers without Apple's SDK.

They state where macOS has the frameworks, and list none of their names: the module looks up all names at run time.
"""


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
    runner: tuple[str, ...] = ()
    packages: str = ""
    variables: dict[str, str] = field(default_factory=dict)
    share: int = 1

    @property
    def is_here(self) -> bool:
        """Whether it is the system that this Python runs on."""
        return self.name == here()

    @property
    def is_linux(self) -> bool:
        """Whether its wheels name the oldest C library with which they run."""
        return "linux" in self.triple


TARGETS = {
    target.name: target
    for target in (
        Target("linux-x64", "x86_64-unknown-linux-gnu", "cc"),
        Target(
            "linux-arm64",
            "aarch64-unknown-linux-gnu",
            "aarch64-linux-gnu-gcc",
            ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"),
            "gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user",
            share=11,
        ),
        Target(
            "windows-x64",
            "x86_64-pc-windows-gnu",
            "x86_64-w64-mingw32-gcc",
            ("wine",),
            "gcc-mingw-w64-x86-64 wine64 wine osslsigncode",
            {"WINEDEBUG": "-all"},
        ),
        Target("macos-arm64", "aarch64-apple-darwin"),
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


def library(target: Target) -> Path:
    """The folder of the compiler's libraries for a system. Raises TargetError if the compiler's is not installed."""
    if shutil.which("rustc") is None:
        raise TargetError("rustc is not on the PATH: install Rust (rustup or the system's packages) first")
    done = subprocess.run(
        ["rustc", "--target", target.triple, "--print", "target-libdir"], capture_output=True, text=True, check=False
    )
    folder = Path(done.stdout.strip())
    if done.returncode != 0 or not list(folder.glob("libstd-*")):
        raise TargetError(
            f"Rust's standard library for {target.name} is not installed: run `rustup target add {target.triple}`, "
            "or install the system's package of it"
        )
    return folder


def variables(target: Target, *, run: bool = False) -> dict[str, str]:
    """The environment in which cargo compiles for a system, and with `run` also runs. Raises TargetError.

    Empty for this machine's own system: cargo is set up for it.
    """
    if target.is_here:
        return {}
    library(target)
    prefix = "CARGO_TARGET_" + target.triple.upper().replace("-", "_")
    found = dict(target.variables) if run else {}
    if target.compiler:
        found[f"{prefix}_LINKER"] = program(target, target.compiler)
    if run:
        if not target.runner:
            raise TargetError(f"programs for {target.name} run only on that system")
        found[f"{prefix}_RUNNER"] = " ".join([program(target, target.runner[0]), *target.runner[1:]])
    return found
