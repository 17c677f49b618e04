# SPDX-License-Identifier: GPL-3.0-or-later
"""Why a ray costs what it costs, in sentences: the parts of its work that found nothing, the largest first."""

from __future__ import annotations

import numpy as np

from ..overlay.cells import Path
from ..tree.table import KIND_LABELS, Table
from .ray_costs import SETS, RayCosts
from .replay import Replay

LEAST = 0.15
"""Smallest share of the work that a sentence is about."""

MOSTLY = 0.5
"""Smallest share of its inner nodes of which a ray is said to meet mostly one kind."""

GRAZING = 6.0
"""Largest angle in degrees between a ray and a plane along which it is said to run."""


def summary(costs: RayCosts, index: int) -> list[str]:
    """The counts of a ray, compared with the median of the rays of its set that have any."""
    lines = []
    for name, values in (("steps", costs.steps), ("tests", costs.tests)):
        middle = float(np.median(values[values > 0])) if values.any() else 0.0
        times = f", {values[index] / middle:.1f} times the median of {middle:,.0f}" if middle else ""
        lines.append(f"{int(values[index]):,} {name if values[index] != 1 else name[:-1]}{times}")
    tests, wasted = int(costs.tests[index]), int(costs.wasted[index])
    if tests:
        usual = costs.wasted.sum() / costs.tests.sum()
        what = "1 test" if wasted == 1 else f"{wasted:,} tests"
        lines.append(f"{what} wasted, {wasted / tests:.0%} of its own; {usual:.0%} of those of all these rays")
    x, y = costs.pixels[index]
    return [f"{SETS[costs.rays.name]} ray of pixel {x}, {y} from the top left", *lines]


def reasons(table: Table, path: Path, replay: Replay, key: str = "TESTS") -> list[str]:
    """Sentences about the work of a path that did not find its hit, and about the shape of that work.

    key: of KEYS; by STEPS, sentences about visited nodes come before those about tests.
    """
    of_tests = [text for share, text in sorted(_of_tests(table, path, replay), reverse=True) if share >= LEAST]
    of_nodes = [text for share, text in sorted(_of_nodes(table, replay), reverse=True) if share >= LEAST]
    lines = [*of_nodes, *of_tests] if key == "STEPS" else [*of_tests, *of_nodes]
    return [*lines, *_along(table, path, replay)]


def _of_tests(table: Table, path: Path, replay: Replay) -> list[tuple[float, str]]:
    """Shares of the tests, with a sentence about each."""
    tested = [step for step in replay.steps if step.tests]
    found: list[tuple[float, str]] = []
    # Tests of leaves that do not hold the triangle hit.
    every = sum(step.tests for step in tested)
    vain = [step for step in tested if path.triangle < 0 or path.triangle not in table.triangles_of(step.node)]
    share = sum(step.tests for step in vain) / every if every else 0.0
    where = "1 leaf" if len(vain) == 1 else f"{len(vain):,} leaves"
    found.append((share, f"{share:.0%} of the tests are in {where} without the triangle hit"))
    # One leaf with most of the tests.
    if tested:
        most = max(tested, key=lambda step: step.tests)
        share = most.tests / every if len(tested) > 1 else 0.0
        found.append((share, f"{share:.0%} of the tests are in one leaf, node {most.node:,} at level {most.depth}"))
    return found


def _of_nodes(table: Table, replay: Replay) -> list[tuple[float, str]]:
    """Shares of the nodes, with a sentence about each."""
    # Steps to leaves without triangles, and to nodes none of whose leaves the ray meets.
    found: list[tuple[float, str]] = []
    leaves = sum(step.leaf >= 0 for step in replay.steps)
    empty = sum(step.leaf >= 0 and not table.counts[step.node] for step in replay.steps)
    inner = [step for step in replay.steps if step.leaf < 0]
    share = empty / len(replay) if len(replay) else 0.0
    found.append((share, f"{share:.0%} of the nodes are empty leaves: the ray passes {empty:,}, of {leaves:,} leaves"))
    dead = _dead_ends(table, replay)
    share = dead / len(inner) if inner else 0.0
    found.append(
        (share, f"{share:.0%} of the inner nodes are dead ends: the ray meets their box, but none of their leaves")
    )
    return found


def _dead_ends(table: Table, replay: Replay) -> int:
    """Number of visited inner nodes without a visited leaf below them."""
    leaves = np.array(sorted(step.node for step in replay.steps if step.leaf >= 0), np.int64)
    inner = np.array([step.node for step in replay.steps if step.leaf < 0], np.int64)
    first = np.searchsorted(leaves, inner)
    return int((np.searchsorted(leaves, inner + table.sizes[inner]) == first).sum()) if len(inner) else 0


def _verb(path: Path) -> str:
    """An any-hit ray ends at the first hit that is found, which need not be the nearest."""
    return "ends at" if path.any_hit else "hits"


def _along(table: Table, path: Path, replay: Replay) -> list[str]:
    """The position of the ray in the tree: its length, and the kind of planes along which it runs."""
    direction = path.direction / np.linalg.norm(path.direction)
    known = path.leave[np.isfinite(path.leave)]
    end = path.t if np.isfinite(path.t) else float(known.max(initial=0.0))
    diagonal = float(np.linalg.norm(table.scene[3:] - table.scene[:3]))
    length = end * float(np.linalg.norm(path.direction))
    hit = f"It {_verb(path)} triangle {path.triangle:,} at distance {path.t:.4g}"
    lines = [
        hit if path.triangle >= 0 else "It hits nothing",
        f"It is {length:.4g} long, {length / diagonal:.0%} of the scene's diagonal" if diagonal else "",
    ]
    angles = np.degrees(np.arcsin(np.clip(np.abs(direction), 0.0, 1.0)))
    axis = int(np.argmin(angles))
    if angles[axis] <= GRAZING:
        lines.append(f"It runs along planes across {'XYZ'[axis]}, at {angles[axis]:.1f}°: its cells are long and thin")
    kinds = np.array([table.kind[step.node] for step in replay.steps if step.leaf < 0], np.int64)
    if len(table.kinds) > 1 and len(kinds):
        most = int(np.argmax(np.bincount(kinds)))
        share = float(np.mean(kinds == most))
        if share >= MOSTLY:
            lines.append(f"{share:.0%} of its inner nodes are of one kind: {KIND_LABELS[most]}")
    return [line for line in lines if line]
