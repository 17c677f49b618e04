# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of one scene's rows: errors against time, distributions, levels of trees, expected against measured cost.

At most seven configurations and Embree are coloured, the same ones in all figures of a scene; the others are grey.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from ...core.measure import ranking, yardstick
from ...core.measure.analysis import field
from ...core.measure.rows import Row, agrees, building
from ...core.report import charts, correlation, tradeoff_charts
from ...core.report import marks as marking
from ...core.report.marks import INK, Mark
from ...core.report.picture_charts import ERRORS
from ...core.report.report import set_names
from .figure import Axis, Figure, Series, counting, logarithmic

PLACES = {"here": "in place", "far": "100,000 sizes away", "grid": "touching boxes"}
"""Captions of the scenes on which errors are measured, by their names in rows."""

PEER = Mark(INK, "X", "Cycles", 5.5, 1.2, 5)


def of_scene(rows: Sequence[Row]) -> list[Figure]:
    """All figures that have data. rows: of one scene."""
    measured = [row for row in rows if row["rays"]]
    if not measured:
        return []
    tables = ranking.by_table(measured)
    single = tables.get("single") or measured
    found = [*_pictures(tables.get("fastest") or measured), *_answers(measured), *_trees(measured)]
    found += [*_work(single), *_costs(single)]
    return [one for one in found if any(series.x for series in one.series)]


def marks_of(rows: Sequence[Row]) -> dict[str, Mark]:
    """The mark of each configuration."""
    return marking.marks(rows, [charts.tracing_seconds(row) for row in rows])


def _ordered(series: Sequence[Series]) -> tuple[Series, ...]:
    """The series with points, the grey ones first so that they are drawn beneath."""
    return tuple(sorted((one for one in series if one.x), key=lambda one: one.mark.is_chosen))


def _pictures(rows: Sequence[Row]) -> Iterator[Figure]:
    """Error of whole pictures against build and render together, one figure per measure."""
    drawn = [row for row in rows if row["curve"] and agrees(row)]
    marks = marks_of(drawn)
    peer = next((row["peer"] for row in drawn if row.get("peer")), [])
    for key, label in ERRORS.items():
        series = []
        for row in drawn:
            points = [(p["seconds"] + building(row), p[key]) for p in row["curve"] if p.get(key)]
            series.append(Series(marks[row["spec"]], *_columns(points)))
        series.append(Series(PEER, *_columns([(p["seconds"], p[key]) for p in peer if p.get(key)])))
        yield Figure(
            f"error-time-{key}",
            f"{label} of pictures against seconds of build and render together, one point per number of samples. "
            "Structures of one error have the same picture.",
            _log("build and render, seconds", [x for one in series for x in one.x]),
            _log(label, [y for one in series for y in one.y]),
            _ordered(series),
        )


def _answers(rows: Sequence[Row]) -> Iterator[Figure]:
    """Wrong answers, and errors of the distance, against the time of a ray: a figure per scene and ray set."""
    marks = marks_of(rows)
    kinds: tuple[tuple[tradeoff_charts.Kind, str, str], ...] = (
        ("wrong", "wrong answers per million rays", "Wrong answers"),
        ("ulp", "error of t, ulp", "The 999th of 1,000 errors of the distance"),
    )
    for kind, label, what in kinds:
        for place, name in tradeoff_charts.panels_of(rows, kind):
            dots = tradeoff_charts.dots(rows, place, name, kind)
            axis, zero = logarithmic(label, [dot.value for dot in dots])
            series, named = [], set()
            for dot in dots:
                mark = marks[dot.spec]
                # Give both variants of a configuration one entry of the legend.
                shown = mark if dot.spec not in named else replace(mark, label=None, order=mark.order)
                named.add(dot.spec)
                series.append(Series(shown, (dot.ns,), (dot.value or zero,), joined=False, hollow=not dot.bounds))
            yield Figure(
                f"{kind}-time-{place}-{name}",
                f"{what} against the time of a ray, {name} rays, {PLACES[place]}. Hollow: without error bounds.",
                _log("nanoseconds per ray", [dot.ns for dot in dots]),
                axis,
                _ordered(series),
            )


def _distinct(rows: Sequence[Row]) -> list[Row]:
    """The row of each tree whose rays are fastest: nodes and traversals share the tree."""
    best: dict[str, Row] = {}
    for row in rows:
        tree = row.get("tree") or row["spec"]
        known = best.setdefault(tree, row)
        if charts.tracing_seconds(row) < charts.tracing_seconds(known):
            best[tree] = row
    return list(best.values())


def _trees(rows: Sequence[Row]) -> Iterator[Figure]:
    """Shapes of the trees: depths and sizes of leaves, nodes and directions per level."""
    known = [row for row in _distinct(rows) if field.value(row, "tree") is not None]
    marks = {spec: _renamed(known, mark, spec) for spec, mark in marks_of(known).items()}

    def lines(of: Any) -> tuple[Series, ...]:
        return _ordered([Series(marks[row["spec"]], *_columns(list(enumerate(of(row))))) for row in known])

    share = Axis("share of leaves, percent", low=0)
    deepest = max((len(field.value(row, "tree", "depths")) - 1 for row in known), default=0)
    yield Figure(
        "leaf-depth",
        "Leaves at each depth; the root has depth 0.",
        counting("depth of a leaf", deepest),
        share,
        lines(lambda row: _percent(field.value(row, "tree", "depths"))),
    )
    sizes = {row["spec"]: field.value(row, "tree", "size", "histogram") for row in known}
    yield Figure(
        "leaf-size",
        "Leaves by the number of triangles that they hold.",
        Axis("triangles in a leaf", ticks=_bins(sizes.values())),
        share,
        lines(lambda row: _percent(sizes[row["spec"]])),
    )
    yield _per_level(
        "nodes-level",
        "Inner nodes at each level of the tree; the root is level 0.",
        "inner nodes",
        lines(lambda row: field.value(row, "tree", "levels", "nodes")),
    )
    yield _per_level(
        "directions-level",
        "Distinct directions of the planes at each level, along axes and oblique; none for boxes.",
        "directions of planes",
        lines(_directions),
    )


def _per_level(name: str, caption: str, label: str, series: Sequence[Series]) -> Figure:
    """Numbers at each level of the trees, on a logarithmic axis."""
    kept = _positive(series)
    most = max((int(one.x[-1]) for one in kept), default=0)
    return Figure(name, caption, counting("level", most), _log(label, [y for one in kept for y in one.y]), kept)


def _log(label: str, values: Sequence[float]) -> Axis:
    return logarithmic(label, values)[0]


def _renamed(rows: Sequence[Row], mark: Mark, spec: str) -> Mark:
    """The mark with the name of the tree instead of the configuration's."""
    row = next(row for row in rows if row["spec"] == spec)
    tree = row.get("tree") or spec
    return mark if mark.label is None or spec == yardstick.SPEC else replace(mark, label=marking.short(tree))


def _directions(row: Row) -> list[int]:
    """Distinct directions of each level's planes."""
    levels = field.value(row, "tree", "levels")
    return [a + b for a, b in zip(levels["directions_axis"], levels["directions_oblique"], strict=True)]


def _work(rows: Sequence[Row]) -> Iterator[Figure]:
    """Distributions of steps and tests over the rays of each set."""
    marks = marks_of(rows)
    for name in set_names(rows):
        for key, label in (("steps", "nodes visited by a ray"), ("tests", "triangles tested by a ray")):
            known = {row["spec"]: field.value(row, "rays", name, key, "histogram") for row in rows}
            known = {spec: histogram for spec, histogram in known.items() if histogram}
            series = [
                Series(marks[spec], *_columns(list(enumerate(_percent(histogram)))))
                for spec, histogram in known.items()
            ]
            yield Figure(
                f"{key}-{name}",
                f"{name.capitalize()} rays by the number of {label.partition(' by')[0]}.",
                Axis(label, ticks=_bins(known.values())),
                Axis("share of rays, percent", low=0),
                _ordered(series),
            )


def _costs(rows: Sequence[Row]) -> Iterator[Figure]:
    """Expected cost by the surface area heuristic against the measured time of a ray."""
    found = correlation.correlation(rows)
    if found is None:
        return
    marks = marks_of(rows)
    points = zip(found.specs, found.expected, found.measured, strict=True)
    series = [Series(marks[spec], (float(x),), (float(y),), joined=False) for spec, x, y in points]
    note = "" if math.isnan(found.pearson) else f"Pearson {found.pearson:.2f}, Spearman {found.spearman:.2f}"
    yield Figure(
        "sah-time",
        "Cost of a random ray by the surface area heuristic, and measured time of a ray, mean over the ray sets.",
        _log("SAH cost, axis steps", list(found.expected)),
        _log("nanoseconds per ray", list(found.measured)),
        _ordered(series),
        note.replace("-", "−"),
    )


def _columns(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(float(x) for x, _ in points), tuple(float(y) for _, y in points)


def _positive(series: Sequence[Series]) -> tuple[Series, ...]:
    """Only the points that a logarithmic axis can show."""
    kept = []
    for one in series:
        points = [(x, y) for x, y in zip(one.x, one.y, strict=True) if y > 0]
        if points:
            kept.append(replace(one, x=_columns(points)[0], y=_columns(points)[1]))
    return tuple(kept)


def _percent(counts: Sequence[int]) -> list[float]:
    total = sum(counts)
    return [100.0 * count / total for count in counts]


def _bins(histograms: Any) -> tuple[tuple[float, str], ...]:
    """The ticks of a histogram of 0, 1, 2–3, 4–7, 8–15, ...: the smallest number of each bin."""
    longest = max((len(one) for one in histograms if one), default=0)
    names = ["0", "1"] + [f"{1 << power}–{(2 << power) - 1}" for power in range(1, longest)]
    step = 1 + longest // 9
    return tuple((float(place), names[place]) for place in range(0, longest, step))
