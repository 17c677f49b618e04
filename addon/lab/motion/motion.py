# SPDX-License-Identifier: GPL-3.0-or-later
"""Animations on the command line: their frames, the table of the methods, and the report's page with its plots."""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ...core.base import interrupt
from ...core.report import page
from ...core.scene import workload
from ...core.structures import specs
from ..base.usage import UsageError, no_blender
from ..report import marks, plots
from . import animations, frames
from .animations import Animation
from .frames import SPECS, Moved

if TYPE_CHECKING:
    from ...core.base.interface import Native

__all__ = ["NUMBERS", "OPTIONS", "PAGE", "SPECS", "check", "find", "read_frames", "run", "table", "written"]

OPTIONS = ("scenes", "frames", "structures", "size", "threads", "level", "out")
"""Options of the benchmark that are valid together with `--frames`."""

NUMBERS, PAGE = "frames.json", "frames.html"
"""Files of a report. The reports of sweeps have other names, so that one folder can hold both."""

MOST_FRAMES = 100_000

BUILT_IN = (*animations.NAMES, *animations.LARGE)
"""Names of all animations that need no file."""

COLUMNS = (
    "animation",
    "structure",
    "way",
    "update, ms",
    "trace, ms",
    "sum, ms",
    "drift",
    "refitted",
    "rebuilt",
    "wrong",
)

FITS = ("animation", "structure", "nodes and leaves", "build, ms", "fit, ms", "fit / build")

INTRODUCTION = (
    "Each frame: the time to bring the structure to the triangles of the frame (<em>refit</em>: the same nodes, moved "
    "bounds; <em>rebuild</em>: a new tree; <em>lazy</em>: rays build what they need, which is part of their time), "
    "the time of all camera rays, and answers compared with brute force. Drift: the expected cost of a ray divided by "
    "that of the last build."
)


def read_frames(text: str) -> range:
    """The frames A-B of a command line, both included. Raises UsageError."""
    first, dash, last = text.partition("-")
    if not (dash and specs.is_whole(first) and specs.is_whole(last) and int(first) <= int(last)):
        raise UsageError(f"--frames: expected A-B with A at most B, such as 1-60, got {text!r}")
    if int(last) - int(first) >= MOST_FRAMES:
        raise UsageError(f"--frames: at most {MOST_FRAMES:,} frames are possible, got {text!r}")
    return range(int(first), int(last) + 1)


def check(names: Sequence[str]) -> list[str]:
    """The animations of a command line, each once. Raises UsageError without Blender for files, WorkloadError."""
    found = {name: workload.find(name, (".blend",), BUILT_IN) for name in names}
    chosen = workload.distinct(found)
    for name in chosen:
        if isinstance(found[name], Path):
            _reader(name)
    return chosen


def find(name: str) -> Animation:
    """A built-in animation, or that of a .blend file, which stays open: its frames are valid until another file is
    opened. Raises UsageError without Blender, WorkloadError.
    """
    found = workload.find(name, (".blend",), BUILT_IN)
    if isinstance(found, str):
        return animations.built_in(found)
    mesh, view = _reader(name).load(found)
    return Animation(found.stem, lambda number: animations.Mesh(*mesh(number)), view)


def _reader(name: str) -> ModuleType:
    """The module that reads animations of files. Raises UsageError without Blender."""
    try:
        with interrupt.guarded():
            from . import blend_file
    except ImportError as error:
        raise UsageError(f"{name}: {no_blender(error)}") from error
    return blend_file


def run(
    native: Native,
    chosen: Iterable[Animation],
    numbers: range,
    listed: Sequence[str],
    *,
    size: tuple[int, int],
    threads: int,
    say: Callable[[str], None],
) -> list[Moved]:
    """All rows of these animations; prints a table of each. Each is taken when the one before it is measured."""
    ways = frames.methods(native, listed)
    rows: list[Moved] = []
    for animation in chosen:
        own = list(frames.measure(native, animation, numbers, ways, size=size, threads=threads, say=say))
        print("\n" + text(COLUMNS, table(own), 3) + "\n", flush=True)
        if fitted := fits(own):
            print(text(FITS, fitted, 2) + "\n", flush=True)
        rows += own
    return rows


def by_method(rows: Iterable[Moved]) -> dict[tuple[str, str, str], list[Moved]]:
    """The rows of each animation, structure and way."""
    found: dict[tuple[str, str, str], list[Moved]] = {}
    for row in rows:
        found.setdefault((row["animation"], row["spec"], row["way"]), []).append(row)
    return found


def table(rows: Iterable[Moved]) -> list[tuple[str, ...]]:
    """One line per animation and method: medians of the frames after the first, the largest drift, and counts."""
    lines = []
    for (animation, spec, way), own in by_method(rows).items():
        later = own[1:] or own
        update, trace = (1e3 * median(row[key] for row in later) for key in ("update_s", "trace_s"))
        both = 1e3 * median(row["update_s"] + row["trace_s"] for row in later)
        drifts = [row["drift"] for row in own if row["drift"] is not None]
        counts = [sum(row["done"] == done for row in own) for done in ("refitted", "rebuilt")]
        wrong = sum(row["wrong"] for row in own)
        drift = f"{max(drifts):.2f}" if drifts else "–"
        numbers = [f"{update:.2f}", f"{trace:.2f}", f"{both:.2f}", drift, *map(str, counts), str(wrong)]
        lines.append((animation, spec, way, *numbers))
    return lines


def fits(rows: Iterable[Moved]) -> list[tuple[str, ...]]:
    """One line per animation and structure that was both fitted and built again: its size, the medians of both times,
    and their ratio.
    """
    lines: list[tuple[str, ...]] = []
    methods = by_method(rows)
    for (animation, spec, way), own in methods.items():
        fitted = [row for row in own if row["done"] == "refitted"]
        rebuilt = [row for row in methods.get((animation, spec, "rebuild"), ()) if row["done"] == "rebuilt"]
        if way != "refit" or not (fitted and rebuilt):
            continue
        build, fit = (1e3 * median(row["update_s"] for row in each) for each in (rebuilt, fitted))
        size = max(row["nodes"] for row in fitted)
        lines.append((animation, spec, f"{size:,}", f"{build:.2f}", f"{fit:.2f}", f"{fit / build:.2f}"))
    return lines


def text(columns: Sequence[str], lines: Sequence[tuple[str, ...]], names: int) -> str:
    """A table for a terminal; its first columns, `names` of them, are aligned to the left."""
    widths = [max(len(line[i]) for line in (columns, *lines)) for i in range(len(columns))]
    put = (str.ljust,) * names + (str.rjust,) * (len(columns) - names)
    return "\n".join(
        "  ".join(side(cell, width) for side, cell, width in zip(put, line, widths, strict=True)).rstrip()
        for line in (columns, *lines)
    )


def written(document: dict[str, Any]) -> dict[str, str]:
    """The files of a report: NUMBERS, whose key `frames` has the rows of `frames.Moved`, and PAGE."""
    return {
        NUMBERS: json.dumps(document, indent=1, allow_nan=False) + "\n",
        PAGE: page.filled("Moving scenes", INTRODUCTION, document, _body(document["frames"])),
    }


def _body(rows: Sequence[Moved]) -> str:
    """A section for each animation: table, reasons for rebuilds, plots."""
    parts = []
    for animation in dict.fromkeys(row["animation"] for row in rows):
        own = [row for row in rows if row["animation"] == animation]
        parts.append(f"<section><h2>{html.escape(animation)}</h2><p>{len({row['frame'] for row in own})} frames, ")
        parts.append(f"{own[-1]['triangles']:,} triangles in the last.</p>")
        parts.append(_as_html(COLUMNS, table(own)))
        if fitted := fits(own):
            parts.append(_as_html(FITS, fitted))
        parts += [f"<p>{html.escape(line)}</p>" for line in reasons(own)]
        if plots.problem() is None:
            parts.append(f"<figure>{plots.svg(partial(draw, rows=own), 6.4)}</figure>")
        parts.append("</section>")
    return "".join(parts)


def _as_html(columns: Sequence[str], lines: Iterable[tuple[str, ...]]) -> str:
    """A table of a page."""
    head = "".join(f"<th>{html.escape(title)}</th>" for title in columns)
    body = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in line)}</tr>" for line in lines)
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def reasons(rows: Iterable[Moved]) -> list[str]:
    """Sentences on frames in which a structure could not be refitted."""
    found: dict[tuple[str, str], int] = {}
    for row in rows:
        if row["why"]:
            key = row["spec"], row["why"]
            found[key] = found.get(key, 0) + 1
    return [f"{spec}: rebuilt instead of refitted in {count} frames: {why}" for (spec, why), count in found.items()]


def draw(figure: Any, rows: Sequence[Moved]) -> None:
    """Update and trace times together, and the drift of the cost, frame by frame."""
    upper, lower = figure.subplots(2, 1, sharex=True)
    for number, ((_, spec, way), own) in enumerate(by_method(rows).items()):
        colour = marks.COLOURS[number % len(marks.COLOURS)]
        places = [row["frame"] for row in own]
        upper.plot(
            places, [1e3 * (row["update_s"] + row["trace_s"]) for row in own], color=colour, label=f"{spec}, {way}"
        )
        if way == "refit":
            lower.plot(places, [row["drift"] for row in own], color=colour)
    upper.set_ylabel("update and rays, ms")
    upper.set_yscale("log")
    upper.legend(frameon=False, fontsize="small", ncols=2)
    lower.set_ylabel("drift of the cost")
    lower.set_xlabel("frame")
