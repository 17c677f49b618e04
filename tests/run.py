# SPDX-License-Identifier: GPL-3.0-or-later
"""Run pytest and end the process at once: `python tests/run.py [--counts FILE] PYTEST-ARGUMENTS...`.

Blender 4.5 as a module hangs when Python ends after a render with a Python engine; leaving by `os._exit` avoids it.
With --counts the numbers of passed, failed, skipped and deselected tests are written to FILE as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path


class Counts:
    """A pytest plugin that counts tests, not phases: a failing fixture and a failing test count once each.

    They are written to the file, if there is one, as they come: a test that hangs ends the process.
    """

    def __init__(self, file: Path | None) -> None:
        self.file = file
        self.outcomes: dict[str, str] = {}
        self.left_out = 0

    def pytest_runtest_logreport(self, report) -> None:
        worse = {"passed": 0, "skipped": 1, "failed": 2}
        known = self.outcomes.get(report.nodeid, "passed")
        self.outcomes[report.nodeid] = max(known, report.outcome, key=worse.__getitem__)
        if report.when == "teardown":
            self.write()

    def pytest_deselected(self, items) -> None:
        self.left_out += len(items)

    def pytest_collectreport(self, report) -> None:
        # A module that is skipped or broken as a whole has no tests to report.
        if report.outcome != "passed":
            self.outcomes[report.nodeid] = report.outcome

    def pytest_sessionfinish(self) -> None:
        self.write()

    def write(self) -> None:
        if self.file is not None:
            found = Counter(self.outcomes.values())
            counts = {name: found[name] for name in ("passed", "failed", "skipped")} | {"left_out": self.left_out}
            self.file.write_text(json.dumps(counts), encoding="utf-8")


def main(arguments: list[str]) -> int:
    # A shell that starts this in the background has it ignore Ctrl-C, and all processes that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    counts_file = None
    if arguments[:1] == ["--counts"]:
        counts_file, arguments = Path(arguments[1]), arguments[2:]
    # Before bpy is imported: tests must neither read nor write the settings of the user's own Blender.
    # Beside the counts, whose folder goes away even if a test that hangs ends this process.
    beside = counts_file.parent if counts_file is not None else None
    with tempfile.TemporaryDirectory(prefix="halfspace-blender-", dir=beside) as resources:
        os.environ["BLENDER_USER_RESOURCES"] = resources
        import pytest

        return int(pytest.main(arguments, plugins=[Counts(counts_file)]))


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)
