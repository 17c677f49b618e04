# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `uv`, which finds Pythons, makes environments and installs into them.

That of the PATH if it is new enough, else a wheel of it in build/uv. Starts under any Python 3.8 or newer.
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
"""Settings of pip that uv reads under another name."""


class SetupError(RuntimeError):
    """An environment cannot be set up. The message says why and what to do."""


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
    """The variables under which uv runs: those of this process, and what uv cannot find out by itself."""
    found = dict(os.environ)
    # The environment to work on is always an argument.
    found.pop("VIRTUAL_ENV", None)
    # pip trusts what the system trusts, and so must uv behind a proxy of an organisation.
    found.setdefault("UV_SYSTEM_CERTS", "1")
    for theirs, ours in OF_PIP.items():
        if os.environ.get(theirs) and not os.environ.get(ours):
            found[ours] = os.environ[theirs]
    # A shim of pyenv starts only versions that are selected, and uv ends at a shim that does not start.
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv") / "versions"
    versions = sorted((path.name for path in pyenv.glob("*")), reverse=True)
    if versions:
        found["PYENV_VERSION"] = ":".join(versions)
    return found


def _install(python: Path) -> None:
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
    found = re.search(r"\d+(\.\d+)+", text)
    return tuple(int(part) for part in found.group().split(".")) if found else ()


def _checked(arguments: list[str], failure: str, environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(arguments, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = "\n".join((done.stderr.strip() or done.stdout.strip()).splitlines()[-15:])
        raise SetupError(f"{failure}:\n{last}")
    return done.stdout
