# SPDX-License-Identifier: GPL-3.0-or-later
"""The development environments: `.venv` for current Blender, `.venv-4.5` for Blender 4.5 LTS, `.venv-portable`.

uv makes them and installs exactly the locked packages; where nothing changed, a call costs a moment. Starts under any
Python 3.8 or newer.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import system_libraries
import uv
import wheel
from uv import SetupError as SetupError

ROOT = Path(__file__).resolve().parents[2]


class NoPythonError(SetupError):
    """The Python that an environment needs is neither on this machine nor to be had."""


@dataclass(frozen=True)
class Environment:
    """One virtual environment: a Blender, the Python that this Blender is tied to, and tools.

    groups: the dependency groups of pyproject.toml whose locked versions are installed into it.
    """

    blender: str
    version: str
    folder: Path
    groups: tuple[str, ...]

    @property
    def python(self) -> Path:
        """The interpreter inside the environment."""
        return self.folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")

    @property
    def lock(self) -> Path:
        """The file with the exact versions and hashes of all packages, made by `scripts/dev/lock.py`."""
        return ROOT / "requirements" / (self.folder.name.lstrip(".") + ".txt")


CURRENT = Environment(
    "5.2",
    "3.13",
    ROOT / ".venv",
    (
        "blender-current",
        "test",
        "build",
        "distribution",
        "check",
        "docs",
        "citation",
        "notebooks",
        "browser",
        "measure",
        "cluster",
    ),
)
LTS = Environment("4.5 LTS", "3.11", ROOT / ".venv-4.5", ("blender-lts", "test"))
PORTABLE = Environment(CURRENT.blender, CURRENT.version, ROOT / ".venv-portable", ("build", "portable"))
"""Builds a wheel for all systems on which Blender runs; has no Blender itself."""

ALL = (CURRENT, LTS, PORTABLE)


def say(text: str) -> None:
    """Print at once what the set-up does."""
    print(f"[set-up] {text}", flush=True)


def continue_in(environment: Environment) -> None:
    """Replace this process by one in the environment's Python, unless its version is that already.

    Makes the environment, still without packages, if it is missing. Exits with 2 if that fails.
    """
    if sys.version_info[:2] == tuple(int(part) for part in environment.version.split(".")):
        return
    try:
        with alone():
            make(environment)
    except SetupError as error:
        print(f"The set-up failed: {error}", file=sys.stderr)
        sys.exit(2)
    arguments = [str(environment.python), *sys.argv]
    if os.name == "nt":
        sys.exit(subprocess.run(arguments, check=False).returncode)
    sys.stdout.flush()
    os.execv(arguments[0], arguments)  # noqa: S606 (an argument list, no shell)


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Wait until no other set-up of this clone runs, and keep others waiting meanwhile.

    Two at once would build the native module twice. Windows does without the lock.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    (ROOT / "build").mkdir(exist_ok=True)
    with (ROOT / "build" / "set-up.lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            say("waiting for another set-up of this clone to end")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def make(environment: Environment) -> None:
    """Make the virtual environment, still without packages, if it is missing or broken. Raises SetupError.

    Raises NoPythonError if there is no Python of its version; uv downloads one only if this machine has none.
    """
    if is_whole(environment):
        return
    say(f"{environment.folder.name}: new environment with Python {environment.version}")
    ours = ".".join(str(number) for number in sys.version_info[:2]) == environment.version
    wanted = getattr(sys, "_base_executable", sys.executable) if ours else environment.version
    # --clear removes an environment that is broken or has another version.
    arguments = ["venv", "--clear", "--no-project", "--python", wanted, str(environment.folder)]
    try:
        uv.run(arguments, "the virtual environment could not be made")
    except SetupError as error:
        if available(environment):
            raise
        raise NoPythonError(
            f"Python {environment.version}, which Blender {environment.blender} needs, was not found: "
            "install it (pyenv, uv or the system's packages) and try again"
        ) from error


def is_whole(environment: Environment) -> bool:
    """Whether the environment's interpreter starts and has the right version."""
    code = "import sys; print('%d.%d' % sys.version_info[:2])"
    try:
        done = subprocess.run([str(environment.python), "-I", "-c", code], capture_output=True, text=True, check=False)
    except OSError:
        return False
    return done.returncode == 0 and done.stdout.strip() == environment.version


def available(environment: Environment) -> bool:
    """Whether this machine has the Python that the environment needs; nothing is downloaded. Raises SetupError."""
    uv.command()
    try:
        uv.run(["python", "find", "--no-project", "--no-python-downloads", environment.version], "no Python was found")
    except SetupError:
        return False
    return True


def prepare_packages(environment: Environment) -> None:
    """Make the Python and the packages of the environment ready. Raises SetupError."""
    make(environment)
    say(f"{environment.folder.name}: looking for changed packages (the first time a few hundred MB are downloaded)")
    _install(environment, ["--require-hashes", "--no-build", "--requirements", str(environment.lock)])


def prepare(environment: Environment) -> None:
    """Make the environment ready: its Python, its packages, the libraries of its Blender. Raises SetupError."""
    prepare_packages(environment)
    try:
        installed = system_libraries.provide(_package_folder(environment, "bpy"))
    except system_libraries.MissingLibrariesError as error:
        raise SetupError(str(error)) from error
    if installed:
        say("installed system libraries for Blender: " + ", ".join(installed))


def install_wheel(*environments: Environment) -> Path:
    """Build the native wheel if its sources changed, and install it where another one is. Raises SetupError."""
    start = time.perf_counter()
    say("native module: looking for changes (a first build takes a few minutes)")
    try:
        path, built = wheel.build(ROOT, CURRENT.python)
    except wheel.BuildError as error:
        raise SetupError(str(error)) from error
    say(f"native module built in {time.perf_counter() - start:.0f} s" if built else "native module is up to date")
    for environment in environments:
        # uv installs a local wheel again if the file has changed since.
        _install(environment, ["--no-deps", str(path)])
    return path


def _install(environment: Environment, arguments: list[str]) -> None:
    command = ["pip", "install", "--quiet", "--python", str(environment.python), *arguments]
    uv.run(command, f"the packages of {environment.folder.name} could not be installed")


def _package_folder(environment: Environment, name: str) -> Path:
    library = "Lib" if os.name == "nt" else f"lib/python{environment.version}"
    return environment.folder / library / "site-packages" / name
