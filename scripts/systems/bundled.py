# SPDX-License-Identifier: GPL-3.0-or-later
"""Wheels as they go into the extension: each named after its build.

Blender unpacks the wheels of all extensions into one folder and takes two of the same name and version for the same
one. A new build would therefore not be unpacked over an old one, Windows could not overwrite a module that is loaded,
and Python would return the module that it has loaded under this name. With the build in the names of distribution and
package, a new build is unpacked and loaded next to the old one.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path

DIGITS = 10
"""Length of the part of the hash that goes into names."""


def build_of(wheels: Sequence[Path]) -> str:
    """A short hash of the names and contents of these wheels. Raises zipfile.BadZipFile and OSError."""
    digest = hashlib.sha256()
    for path in sorted(wheels, key=lambda path: path.name):
        with zipfile.ZipFile(path) as archive:
            for name in sorted(archive.namelist()):
                content = archive.read(name)
                # With the length, two files cannot give the same bytes as one.
                digest.update(f"{path.name} {name} {len(content)}\n".encode())
                digest.update(content)
    return digest.hexdigest()[:DIGITS]


def bundle(wheels: Sequence[Path], folder: Path) -> list[Path]:
    """Write these wheels into `folder`, named after the build that they form. Returns the new files, in that order.

    Raises zipfile.BadZipFile and OSError.
    """
    build = build_of(wheels)
    return [_renamed(path, folder, build) for path in wheels]


def _renamed(wheel: Path, folder: Path, build: str) -> Path:
    """A copy of the wheel whose distribution and package have the build in their names."""
    old, _, rest = wheel.name.partition("-")
    new = f"{old}_{build}"
    record: list[tuple[str, str, str]] = []
    made = folder / f"{new}-{rest}"
    with zipfile.ZipFile(wheel) as source, zipfile.ZipFile(made, "w") as target:
        record_name = None
        for entry in source.infolist():
            content = source.read(entry)
            # Rename the package and the folders of the distribution, "old-VERSION.dist-info" among them.
            top = entry.filename.partition("/")[0]
            if top == old or top.startswith(f"{old}-"):
                entry.filename = new + entry.filename.removeprefix(old)
            place, _, name = entry.filename.rpartition("/")
            is_of_distribution = place.endswith(".dist-info")
            if is_of_distribution and name == "RECORD":
                record_name = entry.filename
                continue
            if is_of_distribution and name == "METADATA":
                content = re.sub(rb"(?m)^Name: .*$", b"Name: " + new.encode(), content, count=1)
            target.writestr(entry, content)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append((entry.filename, f"sha256={digest}", str(len(content))))
        # Write the list of all files last, as the format of wheels recommends.
        if record_name is not None:
            text = io.StringIO()
            csv.writer(text, lineterminator="\n").writerows([*record, (record_name, "", "")])
            target.writestr(record_name, text.getvalue(), zipfile.ZIP_DEFLATED)
    return made
