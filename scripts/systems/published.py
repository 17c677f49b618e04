# SPDX-License-Identifier: GPL-3.0-or-later
"""Published wheels of the native module: taken as an index or a folder holds them, and their hashes checked."""

from __future__ import annotations

import hashlib
import importlib.util
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

DISTRIBUTION = "halfspace-native"

PYTHON = ("--implementation", "cp", "--python-version", "3.11", "--abi", "abi3")
"""pip's options for the stable interface of the oldest Python that a supported Blender has."""

TAGS = {
    "linux-x64": "manylinux_2_28_x86_64",
    "linux-arm64": "manylinux_2_28_aarch64",
    "windows-x64": "win_amd64",
    "macos-arm64": "macosx_11_0_arm64",
}
"""Platform tag of the published wheel by the name of the system, a key of targets.TARGETS."""


class PublishedError(RuntimeError):
    """There is no such wheel, or it is not the one with the given hash. The message gives the reason."""


def take(place: str, version: str, system: str, folder: Path) -> Path:
    """Put the wheel of a version for a system, without a change of its bytes, into `folder`. Returns its path.

    place: the address of a package index, or a folder of wheels. system: a key of TAGS. Raises PublishedError.
    """
    if system not in TAGS:
        raise PublishedError(f"no wheel is published for {system}, only for {', '.join(TAGS)}")
    if importlib.util.find_spec("pip") is None:
        raise PublishedError("pip is not installed: set up the environment with scripts/test.py")
    # Settings of pip on this machine could add another index.
    source = ["--index-url", place] if "://" in place else ["--no-index", "--find-links", str(Path(place).resolve())]
    done = subprocess.run(
        [
            *(sys.executable, "-m", "pip", "download", "--isolated", "--quiet", "--disable-pip-version-check"),
            *("--no-deps", "--only-binary", ":all:", "--platform", TAGS[system], *PYTHON),
            *("--dest", str(folder / system), *source, f"{DISTRIBUTION}=={version}"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    found = list((folder / system).glob("*.whl"))
    if done.returncode != 0 or len(found) != 1:
        # The last line of pip states the cause, those before it what it looked for.
        said = [line for line in done.stderr.splitlines() if line.strip()] or ["pip took no wheel"]
        raise PublishedError(f"{place}: no wheel of {DISTRIBUTION} {version} for {system}: {said[-1].strip()}")
    return found[0]


def check(wheels: Sequence[Path], digests: Sequence[str]) -> None:
    """Compare wheels with the SHA-256 of each, in any order, in hexadecimal digits.

    Raises PublishedError if a wheel has none of these hashes, or if a hash belongs to no wheel.
    """
    wanted = {digest.lower() for digest in digests}
    for digest in sorted(wanted):
        if not re.fullmatch("[0-9a-f]{64}", digest):
            raise PublishedError(f"{digest!r} is not a SHA-256: expected 64 hexadecimal digits")
    found = {hashlib.sha256(path.read_bytes()).hexdigest(): path.name for path in wheels}
    for digest, name in found.items():
        if digest not in wanted:
            raise PublishedError(f"{name}: its SHA-256 is {digest}, which is none of the given")
    missing = sorted(wanted - found.keys())
    if missing:
        raise PublishedError(f"no wheel has the SHA-256 {missing[0]}")
