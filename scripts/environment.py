# SPDX-License-Identifier: GPL-3.0-or-later
"""The development environments: `.venv` for current Blender, `.venv-4.5` for Blender 4.5 LTS, `.venv-portable`.

Whatever is there already is kept, so that a second call costs a moment. Starts under any Python 3.8 or newer.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import interpreters
import system_libraries
import wheel

ROOT = Path(__file__).resolve().parents[1]


class SetupError(RuntimeError):
    """An environment cannot be set up. The message says why and what to do."""


@dataclass(frozen=True)
class Environment:
    """One virtual environment: a Blender, the Python that this Blender is tied to, and tools.

    groups: the dependency groups of pyproject.toml that are installed into it.
    """

    blender: str
    version: str
    folder: Path
    groups: tuple[str, ...]

    @property
    def python(self) -> Path:
        """The interpreter inside the environment."""
        return self.folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


CURRENT = Environment(
    "5.2", "3.13", ROOT / ".venv", ("blender-current", "test", "build", "check", "measure", "cluster")
)
LTS = Environment("4.5 LTS", "3.11", ROOT / ".venv-4.5", ("blender-lts", "test"))
PORTABLE = Environment(CURRENT.blender, CURRENT.version, ROOT / ".venv-portable", ("build", "portable"))
"""Without Blender itself: what builds a wheel for all systems on which Blender runs."""


def say(text: str) -> None:
    """Tell the user what is being done, at once."""
    print(f"[set-up] {text}", flush=True)


def continue_in(version: str) -> None:
    """Go on in a Python of this version: replace this process by one, unless it is one already."""
    if sys.version_info[:2] == tuple(int(part) for part in version.split(".")):
        return
    python = interpreters.find(version)
    if python is None:
        sys.exit(f"Python {version} was not found: install it (pyenv, uv or the system's packages) and try again")
    arguments = [str(python), *sys.argv]
    if os.name == "nt":
        sys.exit(subprocess.run(arguments, check=False).returncode)
    sys.stdout.flush()
    os.execv(arguments[0], arguments)  # noqa: S606 (an argument list, no shell)


def available(environment: Environment) -> bool:
    """Whether this machine has the Python that the environment needs."""
    return (
        interpreters.answers_in_environment(environment.python, environment.version)
        or interpreters.find(environment.version) is not None
    )


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Wait until no other set-up of this clone is running, and keep others waiting meanwhile.

    Two at once would take each other's half-made environments for broken ones. Windows does without the lock.
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


def prepare_packages(environment: Environment) -> None:
    """Make the Python and the packages of the environment ready. Raises SetupError."""
    if not interpreters.answers_in_environment(environment.python, environment.version):
        _create(environment)
    _install_requirements(environment)


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
    stamp = hashlib.sha256(path.read_bytes()).hexdigest()
    for environment in environments:
        arguments = ["install", "--force-reinstall", "--no-deps", str(path)]
        _once(environment, "native", stamp, functools.partial(_pip, environment, arguments))
    return path


def requirements(groups: tuple[str, ...]) -> list[str]:
    """The requirements of these dependency groups of pyproject.toml. Raises SetupError for an unknown group."""
    import tomllib

    known = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
    unknown = [group for group in groups if group not in known]
    if unknown:
        raise SetupError(f"pyproject.toml has no dependency group {unknown[0]!r}")
    return [requirement for group in groups for requirement in known[group]]


def _create(environment: Environment) -> None:
    base = interpreters.find(environment.version)
    if base is None:
        raise SetupError(f"Python {environment.version}, which Blender {environment.blender} needs, was not found")
    say(f"{environment.folder.name}: new environment from {base}")
    shutil.rmtree(environment.folder, ignore_errors=True)
    _run([str(base), "-m", "venv", str(environment.folder)], "the virtual environment could not be made")


def _install_requirements(environment: Environment) -> None:
    wanted = requirements(environment.groups)

    def install() -> None:
        say(f"{environment.folder.name}: installing {', '.join(wanted)} (some are large: this takes minutes)")
        _pip(environment, ["install", *wanted])

    _once(environment, "requirements", "\n".join(wanted), install)


def _once(environment: Environment, name: str, wanted: str, work: Callable[[], None]) -> None:
    """Do `work` unless it was done for the same `wanted` before; a failure leaves no mark."""
    mark = environment.folder / f"halfspace-{name}.txt"
    if mark.is_file() and mark.read_text(encoding="utf-8") == wanted:
        return
    mark.unlink(missing_ok=True)
    work()
    mark.write_text(wanted, encoding="utf-8")


def _pip(environment: Environment, arguments: list[str]) -> None:
    command = [str(environment.python), "-m", "pip", *arguments]
    options = ["--quiet", "--disable-pip-version-check", "--progress-bar", "off"]
    _run(command + options, f"pip failed in {environment.folder.name}")


def _run(command: list[str], failure: str) -> None:
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = "\n".join((done.stderr or done.stdout).splitlines()[-15:])
        raise SetupError(f"{failure}:\n{last}")


def _package_folder(environment: Environment, name: str) -> Path:
    library = "Lib" if os.name == "nt" else f"lib/python{environment.version}"
    return environment.folder / library / "site-packages" / name
