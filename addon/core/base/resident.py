# SPDX-License-Identifier: GPL-3.0-or-later
"""Resident memory of this process, on Linux."""

from __future__ import annotations

from pathlib import Path

STATUS = Path("/proc/self/status")


class Growth:
    """The growth of the resident memory since this object was made.

    The system keeps the process's peak. Where an earlier one was higher, the sizes at calls of `look` count instead,
    which may miss a peak between them.
    """

    def __init__(self) -> None:
        self._begun, self._peak = sizes()
        self._seen = self._begun

    def look(self) -> None:
        """Note the present size."""
        self._seen = max(self._seen, sizes()[0])

    @property
    def bytes(self) -> int | None:
        """The largest growth; None where the system does not report it."""
        self.look()
        peak = sizes()[1]
        most = peak if peak > self._peak else self._seen
        return most - self._begun if self._begun else None


def sizes() -> tuple[int, int]:
    """Bytes now and at their peak; zeros where the system does not report them."""
    try:
        lines = dict(line.split(":", 1) for line in STATUS.read_text(encoding="ascii").splitlines())
        now, peak = (1024 * int(lines[key].split()[0]) for key in ("VmRSS", "VmHWM"))
    except (OSError, KeyError, ValueError):
        return 0, 0
    return now, peak
