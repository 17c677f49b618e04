# SPDX-License-Identifier: GPL-3.0-or-later
"""Stored results of comparisons: a text block in the .blend, and a report in a folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ...core.base import native
from ...core.report import report, results, tables
from .comparing import Found

TEXT = "Halfspace comparison"
"""Prefix of the text blocks with results; the scene's name follows."""


def keep_text(scene: Any, found: Found) -> None:
    """Store a result in the .blend as a text block named after the scene, replacing the last one."""
    title = f"{TEXT}, {scene.name}"
    text = bpy.data.texts.get(title) or bpy.data.texts.new(title)
    text.from_string("\n".join(words(found)))


def words(found: Found) -> Iterator[str]:
    """A result as lines: predicted times of each configuration, the reason, and the measurements."""
    plan = found.comparison.plan
    yield f"{plan.pixels:,} pixels, {plan.samples:,} samples each, up to {plan.max_bounces} bounces"
    yield ""
    for line in found.comparison.lines:
        marks = " (best)" * (line is found.comparison.best) + " (fastest rays)" * (line is found.comparison.fastest)
        if line.problem:
            yield f"{line.spec}: {line.problem}"
        else:
            yield (
                f"{line.spec}: build {line.build:.2f} s + render {line.trace:.2f} s = {line.total:.2f} s; "
                f"{line.answers}{marks}"
            )
    yield ""
    yield from found.notes
    if found.rows:
        yield ""
        yield from tables.text(found.rows).splitlines()
        yield ""
        yield from report.findings(found.rows)


def write_report(folder: Path, found: Found) -> None:
    """Write the files of a report. Raises results.FolderError."""
    from ...core.report import page

    document = results.document(native.load(), found.rows, found.options)
    results.prepare_folder(folder)
    with results.writing(folder):
        results.write_all(
            {
                folder / "bench.json": json.dumps(document, indent=1, allow_nan=False) + "\n",
                folder / "bench.csv": report.as_csv(document["rows"]),
                folder / "report.html": page.as_html(document, answer=found.notes[0]),
            }
        )
