# SPDX-License-Identifier: GPL-3.0-or-later
"""The development environments: `.venv` for current Blender, `.venv-4.5` for Blender 4.5 LTS, `.venv-portable`.

uv, which pip installs into build/uv where the PATH has none, makes them and installs exactly the locked packages; where
nothing changed, a call costs a moment. Starts under any Python 3.9 or newer.
"""

from __future__ import annotations

import contextlib
import ctypes.util
import functools
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

SCRIPTS = "Scripts" if os.name == "nt" else "bin"
"""The folder of an environment's programs."""

UV, VERSION, OLDEST = ROOT / "build" / "uv", "0.13.9", (0, 9)
"""The folder and the version of the uv that is installed, and the oldest of a PATH that has all options used here."""

DEBIAN = "libx11-6 libxrender1 libxfixes3 libxi6 libxext6 libxxf86vm1 libxkbcommon0 libsm6 libgl1 libegl1 libgomp1"
"""The packages with all libraries of the system that Blender's module loads, in Debian 12 and Ubuntu 22.04 or later."""


NOT_IN_THE_WHEEL = {"target", "tests", "benches", "examples", "fuzz", "peers", "__pycache__"}
"""Names of folders, in every crate of the workspace, whose changes do not change the wheel."""


class SetupError(RuntimeError):
    """An environment cannot be set up. The message gives the reason and advice in one line."""


class NoPythonError(SetupError):
    """The Python that the message names is neither on this machine nor to be had."""


@dataclass(frozen=True)
class Environment:
    """A virtual environment: a Blender, the Python that it is tied to, its folder, and its groups in pyproject.toml."""

    blender: str
    version: str
    folder: Path
    groups: tuple[str, ...]

    @property
    def python(self) -> Path:
        """The interpreter inside the environment."""
        return self.folder / SCRIPTS / ("python.exe" if os.name == "nt" else "python")

    @property
    def lock(self) -> Path:
        """The file with the exact versions and hashes of all packages, made by `scripts/dev/lock.py`."""
        return ROOT / "requirements" / (self.folder.name.lstrip(".") + ".txt")


_GROUPS = "blender-current test build distribution check docs citation notebooks browser measure cluster"
CURRENT = Environment("5.2", "3.13", ROOT / ".venv", tuple(_GROUPS.split()))
LTS = Environment("4.5 LTS", "3.11", ROOT / ".venv-4.5", ("blender-lts", "test"))
PORTABLE = Environment(CURRENT.blender, CURRENT.version, ROOT / ".venv-portable", ("build", "portable"))
ALL = (CURRENT, LTS, PORTABLE)
"""The last builds a wheel for all systems on which Blender runs, and has no Blender itself."""


def say(text: str) -> None:
    """Print at once what the set-up does."""
    print(f"[set-up] {text}", flush=True)


def continue_in(environment: Environment) -> None:
    """Replace this process by one in the environment's Python, made if missing, unless it has that version already.

    Exits with 2 if that fails.
    """
    if "{}.{}".format(*sys.version_info) == environment.version:
        return
    try:
        with alone():
            make(environment)
    except SetupError as error:
        sys.stderr.write(f"The set-up failed: {error}\n")
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


def prepare(environment: Environment, *groups: str) -> None:
    """Make the environment ready: its Python, its packages, the libraries of its Blender. Raises SetupError.

    groups: the groups in pyproject.toml whose packages are enough; by default those of the environment.
    """
    make(environment)
    say(f"{environment.folder.name}: looking for changed packages (the first time a few hundred MB are downloaded)")
    # As constraints, the locked packages with their hashes are those that may be installed.
    lock = "--constraints" if groups else "--requirements"
    chosen = [word for group in groups for word in ("--group", group)]
    _install(environment, "--require-hashes", "--no-build", lock, str(environment.lock), *chosen)
    provide_libraries(environment)


def install_wheel(*environments: Environment) -> None:
    """Build the native wheel if its sources changed, and install it where another one is. Raises SetupError."""
    say("native module: looking for changes (a first build takes a few minutes)")
    path, built = build_wheel(CURRENT.python)
    say(f"native module {'built' if built else 'is up to date'}")
    for environment in environments:
        # uv installs a local wheel again if the file has changed since.
        _install(environment, "--no-deps", str(path))


def _install(environment: Environment, *arguments: str) -> None:
    command = ["pip", "install", "--quiet", "--python", str(environment.python), *arguments]
    uv(command, f"the packages of {environment.folder.name} could not be installed")


def make(environment: Environment) -> None:
    """Make the virtual environment, without packages, if it is missing or broken. Raises SetupError, NoPythonError.

    uv downloads a Python only if this machine has none of its version.
    """
    if _version(environment.python)[:2] == tuple(map(int, environment.version.split("."))):
        return
    say(f"{environment.folder.name}: new environment with Python {environment.version}")
    ours = "{}.{}".format(*sys.version_info) == environment.version
    wanted = getattr(sys, "_base_executable", sys.executable) if ours else environment.version
    command()
    try:
        # --clear removes an environment that is broken or has another version.
        uv(["venv", "--clear", "--no-project", "--python", wanted, str(environment.folder)], "no environment was made")
    except SetupError as error:
        try:
            uv(["python", "find", "--no-project", "--no-python-downloads", environment.version], "no Python was found")
        except SetupError:
            raise NoPythonError(f"Python {environment.version}, which Blender {environment.blender} needs") from error
        raise


def fingerprint() -> str:
    """A hash of everything that the wheel is made from; equal as long as the wheel need not be built again."""
    import tomllib

    digest = hashlib.sha256()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    parts = [project.get("build-system"), project.get("project"), project.get("tool", {}).get("maturin")]
    digest.update(json.dumps(parts, sort_keys=True).encode())
    for path in sources():
        # With the length, two files cannot give the same bytes as one.
        content = path.read_bytes()
        digest.update(f"{path.relative_to(ROOT).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def sources() -> list[Path]:
    """The files that the wheel is made from, sorted."""
    found = [ROOT / ".cargo" / "config.toml", ROOT / "LICENSE"]
    for folder, inside, files in os.walk(ROOT / "native"):
        # Removed here, these folders are not entered.
        inside[:] = sorted(set(inside) - NOT_IN_THE_WHEEL)
        found += [Path(folder, name) for name in sorted(files)]
    kinds = {".rs", ".toml", ".lock", ".pyi", ".py", ".md"}
    return [path for path in found if path.is_file() and (path.suffix in kinds or path.name == "LICENSE")]


def build_wheel(
    python: Path, name: str = "wheel", options: Sequence[str] = (), variables: Mapping[str, str] = {}
) -> tuple[Path, bool]:
    """The wheel in the folder `name` below build, and whether it was built now. Raises SetupError.

    python: an interpreter whose environment has maturin. options, variables: those of maturin for another system.
    """
    folder, wanted = ROOT / "build" / name, fingerprint()
    old, stamp = sorted(folder.glob("*.whl")), folder / "fingerprint"
    if len(old) == 1 and stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return old[0], False
    if shutil.which("cargo") is None:
        raise SetupError("cargo is not on the PATH: install Rust (rustup or the system's packages) first")
    # A fresh folder replaces the old one only after success.
    fresh = folder.with_name(folder.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    words = [str(python), "-m", "maturin", "build", "--release", "--out", str(fresh)]
    words += options or ["--interpreter", str(python)]
    variables = {**os.environ, "PYO3_PYTHON": str(python), **variables}
    if subprocess.run(words, cwd=ROOT, env=variables, check=False).returncode != 0:
        raise SetupError("the native module does not build: its compiler's messages are above")
    (made,) = fresh.glob("*.whl")
    (fresh / "fingerprint").write_text(wanted, encoding="utf-8")
    shutil.rmtree(folder, ignore_errors=True)
    fresh.rename(folder)
    return folder / made.name, True


def provide_libraries(environment: Environment) -> None:
    """Install with apt-get the libraries of a Linux that Blender's module lacks. Raises SetupError."""
    module = [str(path) for path in environment.folder.glob("lib/python*/site-packages/bpy/__init__*.so")]
    if not sys.platform.startswith("linux") or shutil.which("ldd") is None or not module:
        return
    linked = subprocess.run(["ldd", *module], capture_output=True, text=True, check=False).stdout
    # Blender itself opens the library EGL, to draw without a window.
    linked += "" if ctypes.util.find_library("EGL") else "libEGL.so.1 => not found"
    if lacking := sorted({*re.findall(r"(\S+) => not found", linked)}):
        words = f"apt-get install --yes --no-install-recommends {DEBIAN}"
        say(f"installing libraries of the system for Blender: {', '.join(lacking)}")
        for step in ("apt-get update", words):
            checked(step.split(), f"Blender lacks {', '.join(lacking)}: on Debian or Ubuntu run: sudo {words}")


def uv(arguments: Sequence[str], failure: str) -> str:
    """Run uv in the project's folder and return its output. Raises SetupError: `failure`, then uv's reason."""
    # The environment to work on is always an argument. uv trusts the system's certificates, as pip does.
    found = {"UV_SYSTEM_CERTS": "1", **{name: text for name, text in os.environ.items() if name != "VIRTUAL_ENV"}}
    for theirs, ours in {"PIP_INDEX_URL": "UV_DEFAULT_INDEX", "PIP_CERT": "SSL_CERT_FILE"}.items():
        if found.get(theirs):
            found.setdefault(ours, found[theirs])
    # Select all versions of pyenv: its shims fail for others, and uv stops at a shim that fails.
    pyenv = Path(found.get("PYENV_ROOT") or Path.home() / ".pyenv") / "versions"
    if versions := sorted((path.name for path in pyenv.glob("*")), reverse=True):
        found["PYENV_VERSION"] = ":".join(versions)
    return checked([str(command()), *arguments], failure, found)


@functools.lru_cache
def command() -> Path:
    """The uv to run; installs one into UV if there is none that is new enough. Raises SetupError."""
    found = shutil.which("uv")
    if found is not None and _version(Path(found)) >= OLDEST:
        return Path(found)
    installed = UV / SCRIPTS / ("uv.exe" if os.name == "nt" else "uv")
    if _version(installed) != tuple(map(int, VERSION.split("."))):
        say(f"uv {VERSION}: installing into {UV}")
        advice = f"uv {VERSION} could not be installed into {UV}: install uv, or for this Python venv and pip"
        checked([sys.executable, "-m", "venv", "--clear", str(UV)], advice)
        pip = [str(installed.with_name("python")), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        checked([*pip, "--only-binary", ":all:", f"uv=={VERSION}"], advice)
    return installed


def _version(program: Path) -> tuple[int, ...]:
    """The version that a program prints; empty if it does not start."""
    try:
        done = subprocess.run([str(program), "--version"], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ()
    return tuple(map(int, re.findall(r"\d+", done.stdout)[:3]))


def checked(arguments: Sequence[str], failure: str, variables: dict[str, str] | None = None) -> str:
    """Run a program in the project's folder. Returns its output. Raises SetupError: `failure`, then its last words."""
    try:
        done = subprocess.run(list(arguments), cwd=ROOT, env=variables, capture_output=True, text=True, check=False)
    except OSError as error:
        raise SetupError(f"{failure}: {error}") from error
    if done.returncode != 0:
        raise SetupError(f"{failure}: {' '.join((done.stderr.strip() or done.stdout).split())[-600:]}")
    return done.stdout
