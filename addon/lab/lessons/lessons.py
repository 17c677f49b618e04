# SPDX-License-Identifier: GPL-3.0-or-later
"""The five lessons: scene, what the overlay shows at first, questions, and the numbers of the answers.

The numbers are counters and sizes, equal on every machine. docs/lessons has a page for each lesson; a test compares its
numbers with these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...core.base import rotation
from ...core.base.arrays import F64
from ...core.measure import accuracy, counting
from ...core.scene import grid, rays
from ...core.scene.rays import RaySet
from ...core.scene.workload import View, Workload, framing_view
from . import shapes

if TYPE_CHECKING:
    from ...core.base.interface import Native

SIZE = (64, 64)
"""Pixels of the views whose rays are counted."""

UP = np.array([0.0, 0.0, 1.0])

Facts = dict[str, str]
"""A short name to a number as its page prints it."""


@dataclass(frozen=True)
class Lesson:
    """A lesson. name: of its file and its page. structures: what a class compares, the first is set in the file.

    depth: first and last level that the overlay shows. parts: what it shows, of PLANES, CELLS.
    """

    name: str
    title: str
    scene: Callable[[], Workload]
    structures: tuple[str, ...]
    questions: tuple[str, ...]
    facts: Callable[[Native], Facts]
    depth: tuple[int, int] = (0, 6)
    parts: tuple[str, ...] = ("PLANES",)


def counted(native: Native, workload: Workload, spec: str, name: str = "diffuse", order: str = "none") -> F64:
    """Mean steps and triangle tests of a ray of a set, (2,). order: "none" one by one, "tile8" in tiles."""
    tracer = native.build(workload.vertices, workload.triangles, "brute", threads=1)
    (some,) = rays.make(workload, tracer, size=SIZE, seed=1, names=(name,))
    tree = native.build(workload.vertices, workload.triangles, spec, threads=1)
    found = counting.counters(tree, replace(some, order="tile8" if order == "tile8" else "none"), 1)
    return np.array([found["steps"].mean(), found["tests"].mean()])


def _references(native: Native, workload: Workload, spec: str) -> float:
    """References per triangle."""
    tree = native.build(workload.vertices, workload.triangles, spec, threads=1)
    return tree.statistics["references"] / len(workload.triangles)


def uneven() -> Workload:
    """A fine sphere in the corner of a large floor."""
    vertices, triangles = shapes.joined(
        [shapes.box((-10.0, -10.0, -0.1), (10.0, 10.0, 0.0)), shapes.sphere((7.0, 7.0, 1.0), 1.0, 48)]
    )
    return Workload("split", vertices, triangles, View(np.array([1.0, -4.0, 5.0]), np.array([6.0, 6.0, 0.5]), UP, 50.0))


def _split_facts(native: Native) -> Facts:
    workload = uneven()
    facts: Facts = {}
    for spec in ("kd", "kd-median"):
        tree = native.build(workload.vertices, workload.triangles, spec, threads=1)
        steps, tests = counted(native, workload, f"{spec}:traversal=dir")
        facts |= {
            f"{spec} expected cost": f"{tree.statistics['sah_cost']:,.0f}",
            f"{spec} steps": f"{steps:.1f}",
            f"{spec} tests": f"{tests:.1f}",
        }
    return facts


def planks(is_turned: bool = True) -> Workload:
    """A lattice of thin bars, turned against all axes or along them."""
    bars = [shapes.box((-5.0, y - 0.1, z - 0.1), (5.0, y + 0.1, z + 0.1)) for y in range(-4, 5) for z in range(-4, 5)]
    mesh = shapes.joined(bars)
    if is_turned:
        mesh = shapes.turned(mesh, rotation.tilt(np.radians(35.0), np.radians(25.0)))
    return Workload("oblique", *mesh, framing_view(*mesh))


def _oblique_facts(native: Native) -> Facts:
    facts: Facts = {}
    for place in ("along", "turned"):
        workload = planks(place == "turned")
        for spec in ("kd", "bsp-wn-plus-kd"):
            steps, tests = counted(native, workload, f"{spec}:traversal=dir")
            facts[f"{spec} {place} steps"], facts[f"{spec} {place} tests"] = f"{steps:.1f}", f"{tests:.1f}"
    return facts


def rows_of_spheres() -> Workload:
    """Rows of spheres that touch the same planes from both sides."""
    mesh = shapes.joined(
        shapes.sphere((1.5 * x, 1.5 * y, 0.4 * ((x + y) % 2)), 0.8, 24) for x in range(4) for y in range(3)
    )
    return Workload("intervals", *mesh, framing_view(*mesh))


def _interval_facts(native: Native) -> Facts:
    workload = rows_of_spheres()
    facts: Facts = {}
    for spec in ("kd", "bih"):
        tree = native.build(workload.vertices, workload.triangles, spec, threads=1)
        facts[f"{spec} references"] = f"{_references(native, workload, spec):.2f}"
        facts[f"{spec} bytes"] = f"{tree.statistics['bytes'] / len(workload.triangles):.0f}"
    facts["wrong"] = f"{wrong(native, workload, 'bih')} of {SIZE[0] * SIZE[1]:,}"
    return facts


def wrong(native: Native, workload: Workload, spec: str, some: RaySet | None = None) -> int:
    """Number of rays whose answers differ from brute force: the primary rays, if no others are given."""
    brute = native.build(workload.vertices, workload.triangles, "brute", threads=1)
    if some is None:
        (some,) = rays.make(workload, brute, size=SIZE, seed=1, names=("primary",))
    tree = native.build(workload.vertices, workload.triangles, spec, threads=1)
    expected, _ = accuracy.traced(brute, some, 1)
    answers, occluded = accuracy.traced(tree, some, 1)
    return int(accuracy.differing(expected, answers, occluded).sum())


def _beam_facts(native: Native) -> Facts:
    workload = replace(rows_of_spheres(), name="beams")
    together = counted(native, workload, "octree-beam", "primary", "tile8")[0]
    alone = counted(native, workload, "octree-beam:traversal=net", "primary")[0]
    scattered = counted(native, workload, "octree-beam:traversal=net")[0]
    return {"together": f"{together:.2f}", "alone": f"{alone:.2f}", "diffuse": f"{scattered:.2f}"}


def touching_boxes() -> Workload:
    """A lattice of touching boxes, with rays along its walls and through its edges and corners."""
    lattice = grid.workload(boxes=3, rays=1 << 13)
    return replace(lattice, name="rounding", view=framing_view(lattice.vertices, lattice.triangles))


def _rounding_facts(native: Native) -> Facts:
    workload = touching_boxes()
    (walls,) = workload.extra
    return {
        "rays": f"{len(walls):,}",
        # Which of the unguarded comparisons fail may depend on the machine.
        "without bounds": f"more than {wrong(native, workload, PUBLISHED, walls) // 100 * 100}",
        "with bounds": f"{wrong(native, workload, 'kd:traversal=ta-b', walls)}",
    }


PUBLISHED = "kd:traversal=ta-b,robust=none"
"""The traversal as published, without error bounds."""

LESSONS: tuple[Lesson, ...] = (
    Lesson(
        "1-split",
        "Costs of a split",
        uneven,
        ("kd", "kd-median"),
        (
            "Where does the first plane of each tree lie, and which triangles are on its sides?",
            "Compute the expected cost of the first split from the triangles and the share of the area on each side.",
            "Which tree has the lower expected cost, and do the steps and tests of rays agree with it?",
        ),
        _split_facts,
    ),
    Lesson(
        "2-oblique",
        "Why oblique planes",
        planks,
        ("bsp-wn-plus-kd", "kd"),
        (
            "How many bars does a plane along an axis cut, and how many a plane along the bars?",
            "Turn the object back so that the bars lie along the axes. What changes in each tree?",
            "An oblique plane costs a dot product. When is it worth it?",
        ),
        _oblique_facts,
        depth=(0, 5),
    ),
    Lesson(
        "3-intervals",
        "Why a BIH has no holes",
        rows_of_spheres,
        ("bih", "kd"),
        (
            "Between the two children of a node there may be a gap, or an overlap. Find one of each.",
            "Why can no triangle lie in a gap?",
            "How many references has a triangle in each tree, and what does that cost in memory?",
        ),
        _interval_facts,
        depth=(0, 3),
    ),
    Lesson(
        "4-beams",
        "Rays in beams",
        rows_of_spheres,
        ("octree-beam", "octree-net"),
        (
            "Pick a ray with Beam in the overlay. Which cells do all rays of the tile visit?",
            "How many steps does a ray cost in a tile, and alone?",
            "Why does the gain end after the first bounce?",
        ),
        _beam_facts,
        depth=(1, 4),
    ),
    Lesson(
        "5-rounding",
        "How rounding makes holes",
        touching_boxes,
        ("kd", "brute"),
        (
            "A ray runs inside a split plane. What is the quotient that gives its distance to that plane?",
            "Compare the traversal of the paper, with Robustness set to none, with brute force. Which rays are wrong?",
            "Why does widening each comparison by an error bound find all hits, and why does it find no false ones?",
        ),
        _rounding_facts,
        depth=(0, 4),
    ),
)
"""All lessons, in their order."""

BY_NAME: Mapping[str, Lesson] = {lesson.name: lesson for lesson in LESSONS}
