# SPDX-License-Identifier: GPL-3.0-or-later
"""The finished rows of several folders as those of one benchmark, if they can be that."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from addon.core.report.results import Journal

from ..base.usage import UsageError

ABOUT_RAYS = {"size": "--size", "seed": "--ray-seed", "reference": "--reference"}
"""Options that rows of one scene must share: the rays, and what answers are compared with. All others, as of how often
a structure is timed and whether it makes pictures, may be its own: a slow one is measured with less.
"""


def read(folders: Sequence[Path]) -> Journal:
    """The rows of all. Raises FolderError, and UsageError where no report can be made of them."""
    for folder in folders:
        if not list(folder.glob("rows*.jsonl")):
            raise UsageError(f"--merge: {folder} holds no rows of a run")
    journals = {folder: Journal(folder) for folder in folders}
    lacking = {folder: journal.lacking() for folder, journal in journals.items()}
    merged, *others = journals.values()
    for other in others:
        merged.merge(other)
    left = merged.lacking()
    for folder, lines in lacking.items():
        for key in left.keys() & lines.keys():
            raise UsageError(f"--merge: {folder}: {lines[key]}")
    check(merged)
    return merged


def check(merged: Journal) -> None:
    """Raise UsageError for a scene whose rows no report may set side by side: they are about other rays, or about other
    triangles under one name.
    """
    runs: dict[str, set[str]] = {}
    sizes: dict[str, set[int]] = {}
    for entry in merged.entries.values():
        if entry.is_benchmark:
            # Journals of earlier versions do not tell the run.
            runs.setdefault(entry.row["scene"], set()).update(filter(None, [entry.run]))
            sizes.setdefault(entry.row["scene"], set()).add(entry.row["triangles"])
    for scene, own in runs.items():
        if other := differing(merged, own):
            raise UsageError(f"--merge: {scene}: its rows are of runs with different {other}; name folders of one")
        if len(sizes[scene]) > 1:
            counts = " and ".join(f"{count:,}" for count in sorted(sizes[scene]))
            raise UsageError(f"--merge: {scene}: its rows are of different scenes, of {counts} triangles")


def differing(merged: Journal, runs: set[str]) -> str:
    """Which of the options that they must share these runs do not, as the command line calls them."""
    asked = [merged.asked.options.get(run) for run in runs]
    known = [options for options in asked if options is not None]
    if len(known) < len(asked) and len(asked) > 1:
        return "options"
    return ", ".join(
        name for key, name in ABOUT_RAYS.items() if any(options.get(key) != known[0].get(key) for options in known)
    )
