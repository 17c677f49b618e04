# SPDX-License-Identifier: GPL-3.0-or-later
"""Reported wrong answers of other ray tracers, theirs and ours: `python scripts/reported.py [--write]`.

Prints the table of docs/correctness.md; with --write replaces it in the page. Exit status: 0 no structure answers
wrongly; 1 some structure does; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from lab.base import inside

if __name__ == "__main__":
    inside.adopt("reported")

from addon.core.base import interrupt

if __name__ == "__main__":
    interrupt.guard("reported")

from addon.core.base import command, native
from addon.core.report import results
from lab.base.usage import Parser
from lab.reported import answers, table

PAGE = Path(__file__).resolve().parents[1] / "docs" / "correctness.md"


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


if __name__ == "__main__":
    # Inside Blender, this script's arguments follow a "--".
    split = sys.argv.index("--") + 1 if "--" in sys.argv else 1
    sys.exit(main(sys.argv[split:]))
