# SPDX-License-Identifier: GPL-3.0-or-later
"""The shared libraries that Blender's module loads from the system: finds and installs missing ones."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

DEBIAN_PACKAGES = {
    "libX11.so": "libx11-6",
    "libXrender.so": "libxrender1",
    "libXfixes.so": "libxfixes3",
    "libXi.so": "libxi6",
    "libXext.so": "libxext6",
    "libXxf86vm.so": "libxxf86vm1",
    "libxcb.so": "libxcb1",
    "libxkbcommon.so": "libxkbcommon0",
    "libSM.so": "libsm6",
    "libICE.so": "libice6",
    "libGL.so": "libgl1",
    "libEGL.so": "libegl1",
    "libgomp.so": "libgomp1",
    "libstdc++.so": "libstdc++6",
    "libuuid.so": "libuuid1",
}
"""Debian package by library, with the names of Debian 12 and of Ubuntu 22.04 and later."""

LOADED_AT_RUN_TIME = ("libEGL.so.1",)
"""Libraries that the module does not link but opens to draw without a window."""


class MissingLibrariesError(RuntimeError):
    """Libraries are missing and could not be installed. The message names the packages."""


def missing(folder: Path) -> list[str]:
    """The libraries that the Blender module in `folder` (the installed package `bpy`) needs and the system lacks.

    Always empty on systems other than Linux, where Blender brings all its libraries.
    """
    if not sys.platform.startswith("linux") or shutil.which("ldd") is None:
        return []
    done = subprocess.run(["ldd", *map(str, folder.glob("__init__*.so"))], capture_output=True, text=True, check=False)
    return sorted({*parse_ldd(done.stdout), *(name for name in LOADED_AT_RUN_TIME if not _can_open(name))})


def parse_ldd(text: str) -> list[str]:
    """The names that `ldd` reports as not found."""
    return sorted(set(re.findall(r"^\s*(\S+) => not found", text, re.MULTILINE)))


def _can_open(name: str) -> bool:
    # In a separate process: an opened library stays loaded, and drivers may print or crash.
    code = f"import ctypes; ctypes.CDLL({name!r})"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def packages(libraries: list[str]) -> list[str]:
    """The Debian packages that contain these libraries; the library's own name if it is not in the table."""
    return sorted({DEBIAN_PACKAGES.get(re.sub(r"\.so.*", ".so", name), name) for name in libraries})


def provide(folder: Path) -> list[str]:
    """Install the libraries that the Blender module in `folder` lacks. Returns the names of the installed packages.

    Needs root and apt-get; otherwise raises MissingLibrariesError with the command to run.
    """
    libraries = missing(folder)
    if not libraries:
        return []
    wanted = packages(libraries)
    command = ["apt-get", "install", "--yes", "--no-install-recommends", *wanted]
    advice = "Blender needs system libraries that are missing: {}. On Debian or Ubuntu run: sudo {}".format(
        ", ".join(libraries), " ".join(command)
    )
    if not may_install():
        raise MissingLibrariesError(advice)
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for arguments in (["apt-get", "update"], command):
        done = subprocess.run(arguments, env=quiet, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise MissingLibrariesError(f"{advice} (tried here: {reason})")
    still = missing(folder)
    if still:
        raise MissingLibrariesError(f"Blender still lacks {', '.join(still)} after installing {', '.join(wanted)}")
    return wanted


def may_install() -> bool:
    """Whether packages can be installed without a password: root on a system with apt-get."""
    return hasattr(os, "geteuid") and os.geteuid() == 0 and shutil.which("apt-get") is not None
