# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a benchmark: finished rows that survive an interruption, and files that are whole or not there."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
import tempfile
from pathlib import Path
from typing import Any

from .benchmark import Row

SCHEMA = 1
JOURNAL = "rows.jsonl"


class FolderError(OSError):
    """The folder cannot be written. The message names it."""


def write(path: Path, text: str) -> None:
    """Write a file so that it is never seen half-written: the old one stays until the new one is complete."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name + ".")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes files that only their owner can read; a report is for others too.
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def prepare_folder(folder: Path) -> None:
    """Make the folder and prove that it can be written. Raises FolderError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise FolderError(f"{folder}: cannot be written: {error.strerror or error}") from error


def machine(native: Any) -> dict[str, Any]:
    """What the numbers depend on besides the program."""
    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "level": native.level(),
    }


def native_fingerprint(native: Any) -> str:
    """A hash of the compiled module: rows measured with another build of it are not taken over."""
    folder = Path(native.__file__).parent
    own = sorted(p for p in folder.glob("halfspace_native*") if p.suffix in {".so", ".pyd"})
    digest = hashlib.sha256(native.__version__.encode())
    for path in own:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def key(*parts: Any) -> str:
    """A short name for everything that a row depends on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


class Journal:
    """Finished rows, one JSON line each, appended as they come."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / JOURNAL
        self.rows: dict[str, Row] = {}
        if not self._path.exists():
            return
        text = self._path.read_text(encoding="utf-8", errors="replace")
        for line in text.splitlines():
            try:
                entry = json.loads(line)
                self.rows[entry["key"]] = entry["row"]
            except (ValueError, KeyError, TypeError):
                # The line that was being written when the process ended; its row is measured again.
                continue
        if text and not text.endswith("\n"):
            self._append("\n")

    def add(self, row_key: str, row: Row) -> None:
        """Keep a finished row, on disk before this returns."""
        self.rows[row_key] = row
        self._append(json.dumps({"key": row_key, "row": row}, allow_nan=False) + "\n")

    def _append(self, text: str) -> None:
        try:
            with self._path.open("a", encoding="utf-8", newline="\n") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise FolderError(f"{self._path}: cannot be written: {error.strerror or error}") from error


def document(native: Any, rows: list[Row], options: dict[str, Any]) -> dict[str, Any]:
    """The content of bench.json."""
    return {
        "schema": SCHEMA,
        "project_version": native.__version__,
        "machine": machine(native),
        "options": options,
        "rows": rows,
    }


def _processor() -> str:
    if sys.platform.startswith("linux"):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
