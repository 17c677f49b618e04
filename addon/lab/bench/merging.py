# SPDX-License-Identifier: GPL-3.0-or-later
"""Merging the finished rows of several folders into those of one benchmark, if they are compatible."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...core.report.results import Journal
from ..base.usage import UsageError

ABOUT_RAYS = {"size": "--size", "seed": "--ray-seed", "reference": "--reference", "own": "--rays"}
"""Options that rows of one scene must share: those of the rays, and the reference. All others, such as the number of
repeats and whether pictures are rendered, may differ: a slow structure is measured with less effort.
"""


def read(folders: Sequence[Path]) -> Journal:
    """The rows of all folders. Raises FolderError, and UsageError if no report can be made of them."""
    for folder in folders:
        if not list(folder.glob("rows*.jsonl")):
            raise UsageError(f"--merge: {folder} holds no rows of a run")
    journals = {folder: Journal(folder) for folder in folders}
    # Merge, and report rows that no other folder completes.
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
    """Raise UsageError for a scene whose rows are not comparable: they belong to different rays, or to different
    triangles under one name.
    """
    runs: dict[str, set[str]] = {}
    sizes: dict[str, set[int]] = {}
    for entry in merged.entries.values():
        if entry.is_benchmark:
            runs.setdefault(entry.row["scene"], set()).add(entry.run)
            sizes.setdefault(entry.row["scene"], set()).add(entry.row["triangles"])
    for scene, own in runs.items():
        if other := differing(merged, own):
            raise UsageError(
                f"--merge: {scene}: its rows belong to runs with different {other}; name folders of one run"
            )
        if len(sizes[scene]) > 1:
            counts = " and ".join(f"{count:,}" for count in sorted(sizes[scene]))
            raise UsageError(f"--merge: {scene}: its rows are of different scenes, of {counts} triangles")


def differing(merged: Journal, runs: set[str]) -> str:
    """Those of the shared options in which these runs differ, by their names on the command line."""
    recorded = [merged.asked.options.get(run) for run in runs]
    known = [options for options in recorded if options is not None]
    # A run without recorded options is not comparable with any other.
    if len(known) < len(recorded) and len(recorded) > 1:
        return "options"
    return ", ".join(
        name for key, name in ABOUT_RAYS.items() if any(options.get(key) != known[0].get(key) for options in known)
    )
