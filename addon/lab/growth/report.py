# SPDX-License-Identifier: GPL-3.0-or-later
"""Growth of times with the number of triangles, as text and as one self-contained HTML page."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ...core.report import page
from ..report import charts, marks, plots
from . import growth
from .growth import BuildFit, Point, TraceFit

GIB = float(1 << 30)

INTRODUCTION = """One surface, a bumpy torus seen from inside its tube, tessellated ever more finely; the rays are the
same on all tessellations. Before anything was timed, answers were compared with those of brute force bit for bit: a
line without times gave answers that differ. Build times are the least of the repeats, by the processor's clock for one
thread; the speed-up of several threads is by the clock on the wall, least against least. Rays are traced on one
thread."""

BUILD = """Processor time of the build on one thread, and the line c n log₂ n that fits best; below, the measured time
divided by this line. A horizontal row of points grows exactly as n log n."""

TRACE = """Nanoseconds per ray on one thread, and below the steps per ray, which no machine changes, against the number
of triangles on a logarithmic axis: what grows as log n is a straight line there."""


def of_spec(points: Sequence[Point]) -> dict[str, list[Point]]:
    """The points of each structure, sorted by size."""
    found: dict[str, list[Point]] = {}
    for point in points:
        found.setdefault(point.spec, []).append(point)
    return {spec: sorted(own, key=lambda point: point.triangles) for spec, own in found.items()}


def build_fit(points: Sequence[Point]) -> BuildFit | None:
    """The fit of one structure's builds on one thread, or None with too few points."""
    pairs = [(p.triangles, seconds) for p in points if (seconds := p.build_seconds(1, "processor")) is not None]
    return growth.fit_build([n for n, _ in pairs], [seconds for _, seconds in pairs])


def trace_fit(points: Sequence[Point], rays: str, key: str = "nanoseconds") -> TraceFit | None:
    """The fit of one structure's times for a ray set, or of a counter's mean."""
    pairs = [(p.triangles, p.rays[rays][key]) for p in points if rays in p.rays]
    return growth.fit_trace([n for n, _ in pairs], [value for _, value in pairs])


def fits(points: Sequence[Point]) -> dict[str, Any]:
    """All fits by structure, as a JSON object."""
    return {
        spec: {
            "build": _plain(build_fit(own)),
            "rays": {name: {key: _plain(trace_fit(own, name, key)) for key in KEYS} for name in _sets(own)},
        }
        for spec, own in of_spec(points).items()
    }


KEYS = ("nanoseconds", "steps")
"""Fitted quantities of each ray set."""


def _plain(fit: BuildFit | TraceFit | None) -> dict[str, Any] | None:
    return None if fit is None else asdict(fit)


def _sets(points: Sequence[Point]) -> list[str]:
    return list(dict.fromkeys(name for point in points for name in point.rays))


def headings(points: Sequence[Point]) -> list[str]:
    """The titles of the columns of `cells`."""
    sets = [f"{name}, ns" for name in _sets(points)]
    return ["structure", "triangles", "build s", "speed-up", "peak GiB", *sets, "compared", "wrong"]


def cells(point: Point, points: Sequence[Point]) -> list[str]:
    """A line of the table. points: all points, which determine the columns."""
    seconds, speed_up = point.build_seconds(1, "processor"), point.speed_up()
    peak = None if point.peak_bytes is None else point.peak_bytes / GIB
    traced = [point.rays.get(name, {}).get("nanoseconds") for name in _sets(points)]
    compared, wrong = ("–", point.error or "–")
    if point.errors is not None:
        errors = point.errors
        # A later build may have failed after the answers were found correct.
        wrong, compared = point.error or str(errors.wrong), f"{errors.rays:,}"
    return [
        point.spec,
        f"{point.triangles:,}",
        *(_number(seconds, 3), _number(speed_up, 2), _number(peak, 2)),
        *(_number(value, 0) for value in traced),
        compared,
        wrong,
    ]


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:,.{digits}f}"


def as_text(points: Sequence[Point]) -> str:
    """The table and the findings, for a terminal."""
    rows = [headings(points), *(cells(point, points) for own in of_spec(points).values() for point in own)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [
        "  ".join(
            text.ljust(width) if i == 0 else text.rjust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    return "\n".join([*lines, "", *findings(points)])


def findings(points: Sequence[Point]) -> list[str]:
    """The results of the fits as sentences."""
    return [sentence for spec, own in of_spec(points).items() for sentence in _findings(spec, own)]


def _findings(spec: str, points: Sequence[Point]) -> Iterator[str]:
    built = build_fit(points)
    if built is not None:
        yield (
            f"{spec}: the build grows as n^{built.power:.3f}, where n log n is n^{built.ideal:.3f} over these sizes; "
            f"{built.constant:.1f} ns × n log₂ n fits within {_within(built.ratios)}"
        )
    for name in _sets(points):
        traced, stepped = (trace_fit(points, name, key) for key in KEYS)
        if traced is not None and stepped is not None:
            yield (
                f"{spec}, {name}: {traced.base:.0f} {traced.slope:+.1f} log₂ n ns per ray within "
                f"{_within(traced.ratios)}, n^{traced.power:.3f}; steps {stepped.base:.1f} {stepped.slope:+.2f} log₂ n "
                f"within {_within(stepped.ratios)}"
            )
    speed_ups = [f"{speed_up:.2f} at {p.triangles:,}" for p in points if (speed_up := p.speed_up()) is not None]
    if speed_ups:
        most = max(threads for point in points for threads in point.builds)
        yield f"{spec}: {most} threads build × {', '.join(speed_ups)}"


def _within(ratios: Sequence[float]) -> str:
    return f"{100 * (min(ratios) - 1):+.0f} to {100 * (max(ratios) - 1):+.0f} %".replace("-", "−")


def as_html(document: dict[str, Any], points: Sequence[Point]) -> str:
    """The HTML page. document: contains the version and the machine."""
    body = [f'<ul class="findings">{"".join(f"<li>{html.escape(line)}</li>" for line in findings(points))}</ul>']
    body.append(_table(points))
    reason = plots.problem()
    if reason:
        body.append(f"<p>Plots are left out: {html.escape(reason)}.</p>")
    else:
        body += [
            f"<figure><h3>{picture.title}</h3>{picture.svg}<figcaption>{picture.caption}</figcaption></figure>"
            for picture in figures(points)
        ]
    return page.filled("Time against the number of triangles", INTRODUCTION, document, "\n".join(body))


def _table(points: Sequence[Point]) -> str:
    head = "".join(f"<th>{html.escape(text)}</th>" for text in headings(points))
    lines = []
    for own in of_spec(points).values():
        for point in own:
            first, *rest = (html.escape(text) for text in cells(point, points))
            kind = "" if point.right else ' class="wrong"'
            lines.append(f'<tr{kind}><th scope="row">{first}</th>{"".join(f"<td>{text}</td>" for text in rest)}</tr>')
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def figures(points: Sequence[Point]) -> list[page.Picture]:
    """The plots; those without data are left out."""
    found = []
    sound = {spec: own for spec, own in of_spec(points).items() if build_fit(own) is not None}
    if sound:
        svg = plots.svg(lambda figure: draw_builds(figure, sound), 5.4)
        found.append(page.Picture("Build", svg, BUILD))
    traced = {spec: own for spec, own in sound.items() if _sets(own)}
    if traced:
        svg = plots.svg(lambda figure: draw_rays(figure, traced), 5.4)
        found.append(page.Picture("Rays", svg, TRACE))
    return found


def draw_builds(figure: Any, by_spec: dict[str, list[Point]]) -> None:
    """Seconds against triangles, and their ratio to c n log n."""
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for number, (spec, own) in enumerate(by_spec.items()):
        fit = build_fit(own)
        assert fit is not None, "only such structures are drawn"
        pairs = [(p.triangles, seconds) for p in own if (seconds := p.build_seconds(1, "processor")) is not None]
        n = np.array([count for count, _ in pairs], np.float64)
        colour, marker = marks.COLOURS[number % len(marks.COLOURS)], marks.MARKERS[number % len(marks.MARKERS)]
        above.plot(n, [seconds for _, seconds in pairs], marker, color=colour, label=f"{spec}: n^{fit.power:.3f}")
        above.plot(n, fit.constant * 1e-9 * n * np.log2(n), "-", color=colour, linewidth=1)
        below.plot(n, fit.ratios, marker + "-", color=colour, linewidth=1)
    charts.logarithmic(above)
    below.axhline(1.0, linestyle=":", color=marks.INK)
    below.set_ylim(0, 2)
    below.grid(visible=True)
    above.set_ylabel("build, seconds")
    below.set_ylabel("over c n log₂ n")
    below.set_xlabel("triangles")
    above.legend(loc="upper left")


def draw_rays(figure: Any, by_spec: dict[str, list[Point]]) -> None:
    """Nanoseconds and steps per ray against triangles, one column per set."""
    sets = _sets([point for own in by_spec.values() for point in own])
    panels = figure.subplots(len(KEYS), len(sets), sharex=True, squeeze=False)
    for row, key in enumerate(KEYS):
        for axes, name in zip(panels[row], sets, strict=True):
            # Draw each structure's measurements, and its fitted line.
            for number, (spec, own) in enumerate(by_spec.items()):
                pairs = [(p.triangles, p.rays[name][key]) for p in own if name in p.rays]
                if not pairs:
                    continue
                n, values = (np.array(part, np.float64) for part in zip(*pairs, strict=True))
                place = number % len(marks.COLOURS)
                colour, marker = marks.COLOURS[place], marks.MARKERS[number % len(marks.MARKERS)]
                axes.plot(n, values, marker, color=colour, label=spec)
                fit = trace_fit(own, name, key)
                if fit is not None:
                    axes.plot(n, fit.base + fit.slope * np.log2(n), "-", color=colour, linewidth=1)
            axes.set_xscale("log")
            axes.set_ylim(bottom=0)
            axes.grid(visible=True)
            if row == 0:
                axes.set_title(name)
            else:
                axes.set_xlabel("triangles")
        panels[row][0].set_ylabel({"nanoseconds": "nanoseconds per ray", "steps": "steps per ray"}[key])
    panels[0][0].legend(loc="upper left")
