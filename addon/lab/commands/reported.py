# SPDX-License-Identifier: GPL-3.0-or-later
"""Reported wrong answers of other ray tracers, theirs and ours: `halfspace reported [--write]`.

Prints the table of docs/correctness.md; with --write replaces it in the page. Exit status: 0 no structure answers
wrongly; 1 some structure does; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ...core.base import command, native
from ...core.report import results
from ..base.places import ROOT
from ..base.usage import Parser, UsageError
from ..reported import answers, table

PAGE = ROOT / "docs" / "correctness.md"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="reported", description=(__doc__ or "").splitlines()[0])
    made.add_argument("--write", action="store_true", help="replace the table in docs/correctness.md")
    return made


def main(arguments: Sequence[str]) -> int:
    """Compare and print. Returns the exit status."""
    return command.run("reported", arguments, parser().parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Print the table, and write it with --write. Returns the exit status."""
    if asked.write and not PAGE.is_file():
        raise UsageError(f"--write: there is no page {PAGE}: this is no clone of the repository")
    tracers, missing = answers.others()
    for reason in missing:
        print(f"[reported] not measured: {reason}")
    found = table.measured(native.load(), tracers)
    rows = table.lines(found)
    print("\n".join(rows))
    if asked.write:
        page = PAGE.read_text(encoding="utf-8")
        results.write_all({PAGE: table.replaced(page, rows).encode()})
    return int(any(row.ours for row in found))
