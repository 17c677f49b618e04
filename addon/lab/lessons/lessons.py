# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons: scene, what the overlay shows at first, questions, and the numbers of the answers.

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
from ...core.measure import accuracy, check, counting
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

    first: one thing to do and to see in the open file, with its panel. depth: first and last level that the overlay
    shows. parts: what it shows, of PLANES, CELLS.
    """

    name: str
    title: str
    scene: Callable[[], Workload]
    structures: tuple[str, ...]
    questions: tuple[str, ...]
    facts: Callable[[Native], Facts]
    first: tuple[str, str]
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
    workload = replace(touching_boxes(), extra=())
    found = {}
    for spec in ("kd", UNBOUNDED):
        tree = native.build(workload.vertices, workload.triangles, spec, threads=1)
        (*_, found[spec]) = check.steps(native, tree, workload, threads=1)
    return {
        "rays": f"{found['kd'].errors.rays:,}",
        # Which of the unguarded comparisons fail may depend on the machine.
        "without bounds": f"more than {found[UNBOUNDED].errors.wrong // 1000 * 1000:,}",
        "with bounds": f"{found['kd'].errors.wrong}",
    }


UNBOUNDED = "kd:robust=none"
"""A kd-tree whose traversal compares without error bounds."""


def meeting() -> Workload:
    """A sphere, a pillar and turned bars on a floor: triangles large and small, along the axes and oblique."""
    places = (-0.6, -0.3, 0.0, 0.3, 0.6)
    bars = shapes.joined(
        shapes.box((-1.5, y - 0.05, z - 0.05), (1.5, y + 0.05, z + 0.05)) for y in places for z in places
    )
    corners, faces = shapes.turned(bars, rotation.tilt(np.radians(35.0), np.radians(25.0)))
    raised = np.ascontiguousarray(corners + np.array([0.0, 0.0, 1.6]), np.float32)
    floor, pillar = shapes.box((-4.0, -3.0, -0.1), (4.0, 3.0, 0.0)), shapes.box((-3.5, -1.0, 0.0), (-2.5, 1.0, 2.0))
    mesh = shapes.joined([floor, shapes.sphere((2.7, 0.0, 1.0), 1.0, 32), (raised, faces), pillar])
    return Workload("families", *mesh, framing_view(*mesh))


ALONE = {
    "kd": ":traversal=dir",
    "bsp-wn-plus-kd": ":traversal=dir",
    "bvh-sah": ":traversal=ordered",
    "bih": ":traversal=ordered",
}
"""Traversals of rays one by one, by structure; that of `octree-net` is its only one."""


def _family_facts(native: Native) -> Facts:
    workload = meeting()
    facts: Facts = {}
    for spec in BY_NAME["0-families"].structures:
        steps, tests = counted(native, workload, spec + ALONE.get(spec, ""))
        facts[f"{spec} references"] = f"{_references(native, workload, spec):.2f}"
        facts[f"{spec} steps"], facts[f"{spec} tests"] = f"{steps:.1f}", f"{tests:.1f}"
    return facts


def _box_facts(native: Native) -> Facts:
    workload = planks()
    facts: Facts = {}
    for spec in ("bvh-sah", *(f"bvh-sah:{more}" for more in ("width=2", "width=4", "quality=fast", "splits=1"))):
        steps, tests = counted(native, workload, f"{spec}{',' if ':' in spec else ':'}traversal=ordered")
        facts |= {
            f"{spec} steps": f"{steps:.1f}",
            f"{spec} tests": f"{tests:.1f}",
            f"{spec} references": f"{_references(native, workload, spec):.2f}",
        }
    return facts


SAMPLES = (1, 4, 16, 64)
"""Samples per pixel whose errors the lesson on error compares."""


def errors(native: Native, workload: Workload) -> F64:
    """Root mean square error, over the visible points of a view, of the share of the sky that is hidden from them: for
    each of SAMPLES, (4,).

    The error of a mean is the difference of two independent means, divided by √2, and needs no reference.
    """
    tree = native.build(workload.vertices, workload.triangles, "kd", threads=1)
    hidden = []
    for seed in range(4 * SAMPLES[-1]):
        (some,) = rays.make(workload, tree, size=SIZE, seed=seed, names=("diffuse",))
        hidden.append(tree.closest(some.origins, some.directions, threads=1).triangle >= 0)
    found = np.stack(hidden).astype(np.float64)
    means = [found.reshape(-1, count, found.shape[1]).mean(axis=1) for count in SAMPLES]
    return np.array([np.sqrt(((one[::2] - one[1::2]) ** 2).mean() / 2) for one in means])


def _error_facts(native: Native) -> Facts:
    found = errors(native, meeting())
    slope = np.polyfit(np.log(SAMPLES), np.log(found), 1)[0]
    facts = {f"error of {count}": f"{error:.3f}" for count, error in zip(SAMPLES, found, strict=True)}
    return facts | {"slope": f"{slope:.2f}".replace("-", "−")}


LESSONS: tuple[Lesson, ...] = (
    Lesson(
        "0-families",
        "kd-tree, BSP, BVH, BIH, octree",
        meeting,
        ("kd", "bsp-wn-plus-kd", "bvh-sah", "bih", "octree-net"),
        (
            "Which of the five structures divide space, and which divide the triangles? Where do two cells overlap?",
            "A plane may cut a triangle. How many references has a triangle in each structure?",
            "How many nodes does a ray visit, and how many triangles does it test? Which of the two costs more?",
        ),
        _family_facts,
        (
            "Choose the five in turn, in the first menu of Structure; for bsp also set the depth from 5 to 8.",
            "kd: axis planes; bsp: gold ones at the bars; bvh: boxes; bih: pairs of planes; octree: halved cubes.",
        ),
        depth=(0, 3),
    ),
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
        (
            "In Overlay set the depth from 0 to 0, then from 0 to 1; choose kd-median in Structure and do it again.",
            "The first plane of kd is at the sphere, that of kd-median in the middle of the floor.",
        ),
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
        (
            "In Overlay press Oblique below the depth. Then press X, Y and Z with Shift, and choose kd in Structure.",
            "Gold planes pass between the bars; the planes of kd cut them.",
        ),
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
        (
            "In Overlay set the depth from 1 to 1, then from 2 to 2.",
            "Two planes of each node, with a gap or an overlap between them.",
        ),
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
        (
            "In One Ray press Pick a Ray and point at a sphere; in Overlay press Beam.",
            "The cells near the camera are the brightest: all 64 rays of the tile visit them.",
        ),
        depth=(1, 3),
    ),
    Lesson(
        "5-rounding",
        "How rounding makes holes",
        touching_boxes,
        ("kd", "brute"),
        (
            "A ray runs inside a split plane. What is the quotient that gives its distance to that plane?",
            "Set Robustness to As Published and press Measure a Sample. How many answers are wrong, and of which rays?",
            "Why does widening each comparison by an error bound find all hits, and why does it find no false ones?",
        ),
        _rounding_facts,
        (
            "Press Measure a Sample in Statistics of the render properties; again with Robustness As Published.",
            "All answers are those of brute force; without error bounds many are wrong.",
        ),
        depth=(0, 4),
    ),
    Lesson(
        "6-boxes",
        "Bounding volume hierarchies",
        planks,
        ("bvh-sah", "bvh-hlbvh"),
        (
            "Where do the boxes of siblings overlap, and what does a ray cost there?",
            "Why does the builder weigh the triangles of a box by its surface area?",
            "Set Width to 2, 4 and 8. What happens to the steps of a ray, and what does a step cost?",
            "Set Build Quality to fast, then to medium with one Spatial Split per triangle. What changes, and why?",
        ),
        _box_facts,
        (
            "In Overlay set the depth from 1 to 1, then from 2 to 2. In Structure set Width to 2 and do it again.",
            "Boxes of siblings reach into each other: no box along the axes fits a turned bar.",
        ),
        depth=(0, 1),
    ),
    Lesson(
        "7-error",
        "Error against run time",
        meeting,
        ("bvh-sah", "kd"),
        (
            "Render with 1, 4, 16 and 64 samples. By which factor does the noise fall from one to the next?",
            "Draw the logarithm of the error over that of the samples. Which slope is it, and what does a digit cost?",
            "A better tree takes longer to build. From how many samples is it worth it?",
            "Does the error depend on the structure?",
        ),
        _error_facts,
        (
            "Render properties: Samples 1, Noise Threshold and Denoise off, press F12; again with 16 samples.",
            "The noise falls to about a quarter.",
        ),
        depth=(0, 1),
    ),
)
"""All lessons, in their order."""

BY_NAME: Mapping[str, Lesson] = {lesson.name: lesson for lesson in LESSONS}
