# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `uv`, which finds Pythons, makes environments and installs into them.

Uses the uv of the PATH if it is new enough, else installs one into build/uv. Runs under Python 3.8 or newer.
"""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

FOLDER = ROOT / "build" / "uv"
"""The private environment that holds uv where the PATH has none."""

VERSION = "0.13.9"
"""The version that is installed into FOLDER."""

OLDEST = (0, 9)
"""The oldest uv of a PATH that is used: it has all options that these scripts need."""

OF_PIP = {"PIP_INDEX_URL": "UV_DEFAULT_INDEX", "PIP_CERT": "SSL_CERT_FILE"}
"""uv's environment variable by pip's for the same setting."""


class SetupError(RuntimeError):
    """An environment cannot be set up. The message gives the reason and advice."""


def run(arguments: Sequence[str], failure: str) -> str:
    """Run uv in the project's folder and return its output. Raises SetupError: `failure`, then uv's last lines."""
    return _checked([str(command()), *arguments], failure, variables())


@functools.lru_cache
def command() -> Path:
    """The uv to run; installs one into FOLDER if there is none. Raises SetupError."""
    found = shutil.which("uv")
    if found is not None and _version(Path(found)) >= OLDEST:
        return Path(found)
    scripts = FOLDER / ("Scripts" if os.name == "nt" else "bin")
    installed = scripts / ("uv.exe" if os.name == "nt" else "uv")
    if _version(installed) != _numbers(VERSION):
        _install(scripts / ("python.exe" if os.name == "nt" else "python"))
    return installed


def variables() -> dict[str, str]:
    """The environment variables for uv: those of this process, and settings that uv does not find by itself."""
    found = dict(os.environ)
    # The environment to work on is always an argument.
    found.pop("VIRTUAL_ENV", None)
    # Trust the system's certificates, as pip does: a proxy of an organisation may use its own.
    found.setdefault("UV_SYSTEM_CERTS", "1")
    for theirs, ours in OF_PIP.items():
        if os.environ.get(theirs) and not os.environ.get(ours):
            found[ours] = os.environ[theirs]
    # Select all versions of pyenv: its shims fail for others, and uv stops at a shim that fails.
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv") / "versions"
    versions = sorted((path.name for path in pyenv.glob("*")), reverse=True)
    if versions:
        found["PYENV_VERSION"] = ":".join(versions)
    return found


def _install(python: Path) -> None:
    """Make the private environment whose Python is `python`, and install uv into it. Raises SetupError."""
    print(f"[set-up] uv {VERSION}: installing into {FOLDER.relative_to(ROOT)}", flush=True)
    advice = f"uv {VERSION} could not be installed into {FOLDER}: install uv, or for this Python venv and pip"
    _checked([sys.executable, "-m", "venv", "--clear", str(FOLDER)], advice)
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary", ":all:"]
    _checked([*pip, f"uv=={VERSION}"], advice)


def _version(path: Path) -> tuple[int, ...]:
    """The version of the uv at `path`; empty if it does not start."""
    try:
        done = subprocess.run([str(path), "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return ()
    return _numbers(done.stdout) if done.returncode == 0 else ()


def _numbers(text: str) -> tuple[int, ...]:
    """The first version number in a text; empty without one."""
    found = re.search(r"\d+(\.\d+)+", text)
    return tuple(int(part) for part in found.group().split(".")) if found else ()


def _checked(arguments: list[str], failure: str, environment: dict[str, str] | None = None) -> str:
    """Run a program in the project's folder and return its output. Raises SetupError: `failure`, then the last lines
    of its errors.
    """
    done = subprocess.run(arguments, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = "\n".join((done.stderr.strip() or done.stdout.strip()).splitlines()[-15:])
        raise SetupError(f"{failure}:\n{last}")
    return done.stdout
