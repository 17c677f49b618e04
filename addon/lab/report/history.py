# SPDX-License-Identifier: GPL-3.0-or-later
"""Speeds by commit and machine: JSON lines that `bench --history` appends, and the page that draws them.

A line is a scene measured at a commit. Speeds are multiples of Embree's in the same rounds, so that machines of one
kind that are differently busy can be compared. Nothing is judged.
"""

from __future__ import annotations

import datetime
import json
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...core.measure import yardstick
from ...core.measure.rows import Row, agrees, by_scene
from . import charts, plots
from .marks import COLOURS, GREY, MARKERS

Line = dict[str, Any]
"""A line of the file. commit, date, machine, scene, size; ratios: by configuration and ray set, the smallest, median
and largest multiple of Embree's speed over the rounds.
"""

MOST_NAMED = 20
"""Largest number of commits that an axis names."""

PAGE = """\
# Speed by commit

Speeds of rays as multiples of those of Embree (embreex, robust, ray by ray) in the same rounds: medians, and bars from
the smallest to the largest round. Each machine has its own picture. `bench --history` measures, the checks append a
line for each commit, and nothing is asserted: a step that is larger than the bars is worth a look.
"""


class HistoryError(ValueError):
    """The file is not one of these lines. The message names the line."""


def lines(rows: Sequence[Row], commit: str, machine: Mapping[str, Any], size: Sequence[int]) -> Iterator[Line]:
    """The lines of a run: rows with right answers that were timed next to Embree."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    about = {"commit": commit, "date": now, "machine": dict(machine), "size": list(size)}
    for scene, own in by_scene(rows).items():
        ratios = {
            row["spec"]: found for row in own if not yardstick.is_foreign(row["spec"]) and (found := _ratios(row))
        }
        if ratios:
            yield {**about, "scene": scene, "ratios": ratios}


def _ratios(row: Row) -> dict[str, list[float]]:
    if row["error"] or row["anchor"] != yardstick.SPEC or not agrees(row):
        return {}
    found = {}
    for name, one in row["rays"].items():
        if one["rounds"] and len(one["rounds"]) == len(one["anchor_rounds"]):
            each = np.array(one["rounds"]) / np.array(one["anchor_rounds"])
            found[name] = [round(float(of(each)), 4) for of in (np.min, np.median, np.max)]
    return found


def append(path: Path, found: Iterable[Line]) -> None:
    """Add lines to a file, which is made if it is not there."""
    with path.open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(line, allow_nan=False) + "\n" for line in found)


def commit(folder: Path) -> str:
    """The hash of the commit that a clone has checked out; "" outside of one."""
    words = ["git", "-C", str(folder), "rev-parse", "HEAD"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def read(path: Path) -> list[Line]:
    """The lines of a file. Raises HistoryError, and OSError where it cannot be read."""
    found = []
    for number, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        try:
            line = json.loads(text)
            [str(line[key]) for key in ("commit", "date", "scene")]
            [str(line["machine"][key]) for key in ("processor", "level")]
            valid = all(len(each) == 3 and min(each) > 0 for sets in line["ratios"].values() for each in sets.values())
        except (ValueError, KeyError, TypeError, AttributeError):
            valid = False
        if not valid:
            raise HistoryError(f"{path}: line {number} is no line of speeds")
        found.append(line)
    return found


def page(found: Sequence[Line]) -> tuple[str, dict[str, str]]:
    """The page in Markdown, and its pictures as SVG by file name; none without matplotlib."""
    machines: dict[str, list[Line]] = {}
    for line in found:
        about = line["machine"]
        machines.setdefault(f"{about['processor']}, {about['level']}", []).append(line)
    text, pictures = [PAGE], {}
    for place, (machine, own) in enumerate(machines.items(), 1):
        commits = commits_of(own)
        counted = "1 commit" if len(commits) == 1 else f"{len(commits)} commits"
        text.append(f"## {machine}\n\n{counted}, {commits[0][:10]} to {commits[-1][:10]}.\n")
        if not plots.problem():
            name = f"speed-{place}.svg"
            height = 1.0 + 2.3 * len({line["scene"] for line in own})
            pictures[name] = plots.svg(partial(draw, found=own), height)
            text.append(f"![Speeds by commit on {machine}](pictures/{name})\n")
    return "\n".join(text), pictures


def commits_of(found: Sequence[Line]) -> list[str]:
    """The commits of these lines, in the order in which they were first measured."""
    return list(dict.fromkeys(line["commit"] for line in sorted(found, key=lambda line: str(line["date"]))))


def draw(figure: Any, found: Sequence[Line]) -> None:
    """A panel for each scene and ray set, a line for each configuration. found: the lines of one machine."""
    commits = commits_of(found)
    scenes = list(dict.fromkeys(line["scene"] for line in found))
    sets = list(dict.fromkeys(name for line in found for one in line["ratios"].values() for name in one))
    specs = list(dict.fromkeys(spec for line in found for spec in line["ratios"]))
    panels = figure.subplots(len(scenes), len(sets), squeeze=False, sharex=True, sharey="row")
    for scene, row in zip(scenes, panels, strict=True):
        for name, axes in zip(sets, row, strict=True):
            for number, spec in enumerate(specs):
                points = _points([line for line in found if line["scene"] == scene], commits, spec, name)
                if points:
                    x, low, median, high = np.array(points).T
                    colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number // len(COLOURS) % len(MARKERS)]
                    bars = [median - low, high - median]
                    # Configurations lie side by side, so that their bars do not cover each other.
                    shifted = x + 0.05 * (number - (len(specs) - 1) / 2)
                    axes.errorbar(shifted, median, bars, fmt=marker + "-", color=colour, markersize=4, label=spec)
            if not axes.containers:
                axes.set_axis_off()
                continue
            axes.axhline(1.0, color=GREY, linewidth=1)
            axes.set_title(f"{scene}: {name}", fontsize=8)
            axes.set_yscale("log")
            charts.plain_numbers(axes.yaxis)
            axes.grid(visible=True)
        row[0].set_ylabel("times Embree")
    # Name as many commits as there is room for.
    named = range(0, len(commits), -(-len(commits) // MOST_NAMED))
    for axes in panels[-1]:
        axes.set_xticks(named, [commits[place][:7] for place in named], rotation=90)
    handles = {
        label: handle for axes in panels.flat for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)


def _points(
    found: Sequence[Line], commits: Sequence[str], spec: str, name: str
) -> list[tuple[float, float, float, float]]:
    """Place of the commit, smallest, median and largest ratio; several runs of a commit are one point."""
    points = []
    for place, one in enumerate(commits):
        runs = [
            line["ratios"][spec][name]
            for line in found
            if line["commit"] == one and name in line["ratios"].get(spec, {})
        ]
        if runs:
            low, median, high = np.array(runs).T
            points.append((float(place), float(low.min()), float(np.median(median)), float(high.max())))
    return points
