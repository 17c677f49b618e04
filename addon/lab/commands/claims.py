# SPDX-License-Identifier: GPL-3.0-or-later
"""The claims of papers about their structures, measured again on this machine.

`halfspace claims [CLAIM ...] [options]` continues an earlier run with the same `--out`; `halfspace claims table --out
DIR` writes DIR/statements.md, the statements of the sources with the verdicts kept there, and with `--write` the tables
and plots of docs/papers.md and docs/planes-or-boxes.md; it lists the sentences there whose numbers are not among those
measured. Exit status: 0 every claim was measured, whether it holds or not; 1 some answer differed from brute force,
except in traversals as published without error bounds; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import functools
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.base import command
from ...core.report import results
from ...core.scene import workload
from ..base import levels
from ..base.progress import Progress
from ..base.usage import Parser, UsageError, output
from ..bench import peers
from ..claims import claims, document, statements
from ..claims import report as claims_report
from ..claims import table as claims_table

if TYPE_CHECKING:
    from ...core.base.interface import Native

DOCUMENTS = Path(__file__).parents[3] / "docs"
PAGES = tuple(DOCUMENTS / name for name in ("papers.md", "planes-or-boxes.md"))
"""The documents whose tables and plots `table --write` replaces."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="claims", description=(__doc__ or "").splitlines()[0])
    add = made.add_argument
    add("claims", nargs="*", metavar="CLAIM", help="which claims (default: all); `list` prints them, `table` see above")
    add("--quick", action="store_true", help="fewer repeats, smaller pictures, fewer scenes")
    add(
        "--peers",
        metavar="NAME[,NAME...]",
        help="other ray tracers, for claims about them: tinybvh, embree, as in bench",
    )
    levels.add_option(made)
    add("--out", type=output, metavar="DIR", help="write claims.json and claims.html")
    add(
        "--write",
        action="store_true",
        help="with `table`: replace tables and plots of docs/papers.md and docs/planes-or-boxes.md",
    )
    return made


def main(arguments: Sequence[str]) -> int:
    """Measure and print. Returns the exit status."""
    return command.run("claims", arguments, parser().parse_args, run, keeps=lambda asked: asked.out)


def run(asked: argparse.Namespace) -> int:
    """Measure the claims. Returns the exit status. Raises the errors that `main` reports in one line."""
    known = {claim.id: claim for claim in claims_table.CLAIMS}
    if asked.claims == ["list"]:
        print("\n".join(f"{claim.id}: {claim.statement}" for claim in known.values()))
        return 0
    if asked.claims == ["table"]:
        return write_table(asked.out, PAGES if asked.write else ())
    unknown = [name for name in asked.claims if name not in known]
    if unknown:
        raise UsageError(f"unknown claim {unknown[0]!r}; there are {', '.join(known)}")
    module = levels.load_module(asked.level)
    if asked.peers:
        peers.register(asked.peers, say)
    if asked.out is not None:
        results.prepare_folder(asked.out)
    # Reuse or measure one claim after the other.
    progress = Progress("claims")
    lab = claims.Lab(module, quick=asked.quick, say=progress.say, scenes=workload.SCENES)
    chosen = [known[name] for name in asked.claims] or list(known.values())
    journal = results.Journal(asked.out) if asked.out is not None else None
    fixed = [claims.VERSION, module.__version__, results.native_fingerprint(module), module.level(), asked.quick]
    machine = results.machine(module)
    found: list[claims.Result] = []
    for place, claim in enumerate(chosen):
        key = results.key(*fixed, lab.fingerprints(claim.scenes), claim.id, claim.statement)
        entry = None if journal is None else journal.entries.get(key)
        if entry is not None:
            result = kept(claim, entry.row)
        else:
            with progress:
                lab.show = functools.partial(progress.show, done=place / len(chosen))
                (result,) = claims.measure(lab, [claim])
            result = replace(result, machine=machine["name"])
            # A claim that could not be measured is tried again by the next run.
            if journal is not None and result.measured:
                journal.add(results.Entry(key, (0, place), row(result)), machine)
        found.append(result)
        print("\n" + claims_report.as_text(found[-1]) + "\n", flush=True)
        say(f"{claim.id}: {result.seconds:.1f} processor seconds")
    say(f"{claims_report.summary(found)}; {sum(result.seconds for result in found):.0f} processor seconds")
    if journal is not None:
        save(asked.out, module, found, quick=asked.quick, machines={machine["name"]: machine} | journal.machines)
    return 1 if any(result.wrong for result in found) else 0


def write_table(folder: Path | None, pages: Sequence[Path] = ()) -> int:
    """Write the statements of the sources with the verdicts of the folder's claims, and the tables and plots of pages.

    Raises UsageError, FolderError, and ValueError for marks of a page.
    """
    if folder is None:
        raise UsageError("table: --out names the folder of the measured claims")
    kept_rows = (entry.row for entry in results.Journal(folder).entries.values() if "outcomes" in entry.row)
    latest = {row["outcomes"][0]["claim"]: row["outcomes"] for row in kept_rows if row["outcomes"]}
    rows = [outcome for outcomes in latest.values() for outcome in outcomes]
    files = {folder / "statements.md": statements.table(rows)}
    for page in pages:
        files[page] = document.written(page.read_text(encoding="utf-8"), rows)
        # Take the plots that the page shows from the folder.
        for name in re.findall(r"\(\.\./\.pictures/([\w-]+\.svg)\)", files[page]):
            if (folder / name).is_file():
                files[page.parents[1] / ".pictures" / name] = (folder / name).read_text(encoding="utf-8")
    results.write_all(files)
    for path in files:
        say(f"wrote {path}")
    for page in pages:
        for sentence in document.doubtful(files[page], rows):
            say(f"not among the numbers measured: {sentence}")
    return 0


def row(result: claims.Result) -> dict[str, Any]:
    """A measured claim as a row of the journal."""
    return {
        "outcomes": list(result.as_rows()),
        "wrong": result.wrong,
        "machine": result.machine,
        "seconds": result.seconds,
    }


def kept(claim: claims.Claim, known: Mapping[str, Any]) -> claims.Result:
    """A claim that was measured before, from its row."""
    outcomes = tuple(map(claims.outcome, known["outcomes"]))
    return claims.Result(claim, outcomes, known["wrong"], known["machine"], known["seconds"])


def save(
    folder: Path,
    module: Native,
    found: Sequence[claims.Result],
    *,
    quick: bool,
    machines: Mapping[str, dict[str, Any]] | None = None,
) -> None:
    """Write the files atomically. machines: known ones, by name. Raises FolderError."""
    rows = [row for result in found for row in result.as_rows()]
    document = results.document(module, rows, {"quick": quick}, machines)
    page = claims_report.as_html(found, document["machines"], quick=quick)
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    with results.writing(folder):
        drawn = {folder / name: svg for name, svg in claims_report.pictures(found).items()}
        results.write_all({folder / "claims.json": text, folder / "claims.html": page, **drawn})
    say(f"wrote {folder / 'claims.html'}, claims.json and {len(drawn)} plots (.svg)")


def say(text: str) -> None:
    """Print a line of progress."""
    print(f"[claims] {text}", flush=True)
