# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving scenes, the reason that Wächter and Keller give for intervals: a new tree for each frame, or a fitted one.

Every built-in animation is measured frame by frame: the update of the structure, the camera rays, the drift of the
expected cost, and answers compared with brute force.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from statistics import median

from ...core.measure.accuracy import Errors, total
from ..motion import animations, frames
from ..motion.frames import Method, Moved
from .claims import Chart, Claim, Lab, Outcome, verdict
from .intervals import PAPER

FRAMES = {True: range(0, 60, 15), False: range(60)}
"""Frames of each animation, one period: in a quick run (True) and a full one."""

SIZE = (512, 512)
"""Width and height of a picture in pixels."""

INTERVALS = ("bih", "bih-sah")
OTHERS = ("bvh-sah", "kd", "bsp-wn-plus-kd")
"""Structures compared with: the others that are measured frame by frame by default."""

WAYS: Mapping[str, tuple[str, ...]] = {
    "by a new tree for each frame, as published": ("rebuild", "lazy"),
    "also by fits": ("refit", "rebuild", "lazy"),
}
"""How structures follow the triangles. Rays go together, which is ours."""

Rows = Mapping[tuple[str, Method], Sequence[Moved]]
"""The frames after the first of each animation and method."""


def measured(lab: Lab) -> Rows:
    """All frames of all animations after the first; records the answers that were compared, those of the first too."""
    methods = frames.methods(lab.native, (*INTERVALS, *OTHERS))
    numbers = FRAMES[lab.quick]
    found: dict[tuple[str, Method], list[Moved]] = {}
    for name in animations.NAMES:
        lab.say(f"{name}: {len(numbers)} frames")
        sums: dict[str, list[Errors]] = {}
        for row in frames.measure(lab.native, animations.built_in(name), numbers, methods, size=SIZE):
            wrong, triangle, bits = row["wrong"], row["wrong_triangle"], row["last_bits"]
            errors = Errors(rays=row["compared"], wrong=wrong, wrong_triangle=triangle, last_bits=bits)
            sums.setdefault(row["spec"], []).append(errors)
            if row["frame"] != numbers.start:
                found.setdefault((name, Method(row["spec"], row["way"])), []).append(row)
        for spec, parts in sums.items():
            lab.compared(name, spec, "moving", total(parts))
    return found


def whole(row: Moved) -> float:
    """Seconds of a frame: the update and the rays."""
    return row["update_s"] + row["trace_s"]


def milliseconds(rows: Rows, name: str, method: Method) -> tuple[float, float]:
    """Median milliseconds of the update and of the whole frame."""
    own = rows[name, method]
    return 1e3 * median(row["update_s"] for row in own), 1e3 * median(map(whole, own))


def described(rows: Rows, name: str, methods: Sequence[Method]) -> str:
    """Update and whole frame of each method in an animation, as text."""
    parts = []
    for method in methods:
        update, frame = milliseconds(rows, name, method)
        parts.append(f"{method.name} {update:.2f} and {frame:.1f}")
    return f"{name}: {'; '.join(parts)}"


def shortest(rows: Rows, name: str, methods: Sequence[Method]) -> Method:
    """The method of the shortest frame in an animation."""
    return min(methods, key=lambda method: milliseconds(rows, name, method)[1])


def explained(rows: Rows, methods: Sequence[Method]) -> str:
    """The drift of fitted trees, and the fits that were not possible."""
    parts = []
    for method in methods:
        own = [row for (_, other), found in rows.items() if other == method for row in found]
        drift = max(row["drift"] or 0.0 for row in own)
        done = sum(row["done"] == "refitted" for row in own)
        parts.append(f"{method.spec} {drift:.2f} ({done} of {len(own)} frames fitted, the others built)")
    return f"largest drift of the expected cost by fits: {'; '.join(parts)}"


def drawn(rows: Rows, methods: Sequence[Method]) -> tuple[Chart, ...]:
    """A plot for each animation: milliseconds of each frame."""
    return tuple(
        Chart(
            f"Moving scenes: {name}",
            "frame",
            "update and rays, ms",
            {method.name: [(row["frame"], 1e3 * whole(row)) for row in rows[name, method]] for method in methods},
        )
        for name in animations.NAMES
    )


def moving(lab: Lab) -> Iterator[Outcome]:
    """Intervals against boxes and planes: the time of whole frames, update and rays."""
    rows = measured(lab)
    every = list(dict.fromkeys(method for _, method in rows))
    fits = [method for method in every if method.way == "refit"]
    for way, ways in WAYS.items():
        methods = [method for method in every if method.way in ways]
        first = [shortest(rows, name, methods) for name in animations.NAMES]
        won = sum(method.spec in INTERVALS for method in first)
        told = ". ".join(described(rows, name, methods) for name in animations.NAMES)
        yield Outcome(
            "best",
            verdict(holds=2 * won > len(first)),
            f"{way}: intervals take the shortest time in {won} of {len(first)} animations. Median ms of the update and "
            f"of the frame with {SIZE[0]} × {SIZE[1]} rays, wall-clock time. {told}",
            explained(rows, fits),
            lab.errors(animations.NAMES, {method.spec for method in methods}),
            {f"{name}, {method.name}": milliseconds(rows, name, method)[1] for name, method in rows},
            drawn(rows, methods) if methods == every else (),
        )


CLAIMS = (
    Claim(
        "moving-intervals",
        PAPER,
        "Interval hierarchies are what moving scenes want: quick to build, and quick to fit.",
        moving,
    ),
)
