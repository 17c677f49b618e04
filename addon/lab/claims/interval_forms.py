# SPDX-License-Identifier: GPL-3.0-or-later
"""Wächter and Keller, the forms of interval hierarchies: against boxes, by split candidate, the fifth case, one, two,
four or more planes, oblique planes, rays in groups, and rays without error bounds.

Every form is compared with the plain hierarchy in the same run, and with kd-trees where the source names them; the best
of these clips its triangles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from ...core.scene.workload import Workload
from ...core.structures.specs import joined
from ..stability import stability
from . import intervals, paper_scenes
from .claims import Claim, Lab, Outcome, Timing, verdict
from .intervals import PAPER, SCENE

PLAIN = intervals.INTERVALS

BOXES = {"faithful": "bvh-sah:width=2,traversal=ordered", "best": "bvh-sah:traversal=ordered"}
"""Hierarchies of boxes: two to a node as published, and eight."""

ALIKE = 1.5
"""The source's 'comparable' as a number: at most this ratio."""

SPLITS = {name: f"bih:split={name},traversal=ordered" for name in ("middle", "median", "sah")} | {"grid": PLAIN}
FIFTH = {"faithful": "bih5:cut=split,traversal=ordered", "best": "bih5:traversal=ordered"}
PLANES = {"1": "bih1", "2": "bih", "4": "bih-n:n=2", "8": "bih-n", "16": "bih-n:n=8"}
"""Hierarchies by the number of planes of a node."""

OBLIQUE = ("bih-obl:k=3,traversal=ordered", "bih-obl:traversal=ordered")
"""The same hierarchy along the axes alone, and with planes along diagonals."""

GROUPS = {"faithful": "packet", "best": "tile"}
UNGUARDED = {"faithful": "kd-sah:robust=none,traversal=dir", "best": "kd:robust=none,traversal=dir"}
HOLES = ("touching boxes", "signs of zero", "coplanar", "corners of boxes", "octants", "view on the lattice")
"""Extreme test cases whose rays lie in walls, along edges and through corners."""


def pictures(lab: Lab, workload: Workload, specs: Sequence[str]) -> Mapping[str, Timing]:
    """The time of a picture through each structure, and its counters."""
    size = intervals.SIZE
    view = partial(paper_scenes.camera_rays, workload, size)
    return lab.seconds(workload, specs, lab.rays(workload, "{}x{}".format(*size), view))


def steps(found: Mapping[str, Timing]) -> str:
    """Nodes and tests per ray of each structure, as text."""
    parts = (f"{spec} {t.counters['steps']:.1f} nodes and {t.counters['tests']:.1f} tests" for spec, t in found.items())
    return f"per ray: {'; '.join(parts)}"


def size_of(lab: Lab, workload: Workload, spec: str) -> float:
    """Bytes of a structure."""
    return float(lab.statistics(workload, spec)["bytes"])


def against_boxes(lab: Lab) -> Iterator[Outcome]:
    """Build and memory against a hierarchy of boxes, and nodes per ray against a kd-tree."""
    workload = intervals.scene(lab)
    for configuration, boxes in BOXES.items():
        specs = (PLAIN, boxes)
        builds = lab.build_seconds(workload, specs)
        found = pictures(lab, workload, specs)
        values = {
            "build": builds.seconds[PLAIN] / builds.seconds[boxes],
            "memory": size_of(lab, workload, PLAIN) / size_of(lab, workload, boxes),
            "picture": found[PLAIN].seconds / found[boxes].seconds,
        }
        yield Outcome(
            configuration,
            verdict(holds=values["build"] <= ALIKE and values["memory"] <= ALIKE),
            f"{workload.name}: {PLAIN} takes {values['build']:.2f} of the build ({builds.method}), "
            f"{values['memory']:.2f} of the memory and {values['picture']:.2f} of the time of a picture of {boxes} "
            f"(limit of the first two: {ALIKE:g})",
            steps(found),
            lab.error(workload, specs),
            values,
        )


def candidates(lab: Lab) -> Iterator[Outcome]:
    """The grid against candidates that read the boxes of the node first."""
    workload = intervals.scene(lab)
    builds = lab.build_seconds(workload, tuple(SPLITS.values()))
    found = pictures(lab, workload, tuple(SPLITS.values()))
    quickest = min(SPLITS, key=lambda name: builds.seconds[SPLITS[name]])
    listed = ", ".join(
        f"{name} {builds.seconds[spec] * 1e3:.0f} and {found[spec].seconds * 1e3:.0f}" for name, spec in SPLITS.items()
    )
    yield Outcome(
        "best",
        verdict(holds=quickest == "grid"),
        f"{workload.name}: ms of the build ({builds.method}) and of a picture: {listed}",
        steps(found),
        lab.error(workload, tuple(SPLITS.values())),
        {f"build {name}": builds.seconds[spec] for name, spec in SPLITS.items()}
        | {f"picture {name}": found[spec].seconds for name, spec in SPLITS.items()},
    )


def fifth_case(lab: Lab) -> Iterator[Outcome]:
    """Nodes of one child, as published and by surface, against the same tree without cuts."""
    workload = intervals.scene(lab)
    bare = "bih:empty=0,traversal=ordered"
    for configuration, spec in FIFTH.items():
        specs = (bare, PLAIN, spec)
        found = pictures(lab, workload, specs)
        share = found[spec].seconds / found[bare].seconds
        memory = size_of(lab, workload, spec) / size_of(lab, workload, bare)
        yield Outcome(
            configuration,
            verdict(holds=share < 1),
            f"{workload.name}: a picture takes {share:.2f} of the time of {bare} with {spec}, "
            f"{found[PLAIN].seconds / found[bare].seconds:.2f} with {PLAIN}, which cuts by empty leaves; memory "
            f"{memory:.2f}",
            steps(found),
            lab.error(workload, specs),
            {"ratio": share, "memory": memory},
        )


def planes(lab: Lab) -> Iterator[Outcome]:
    """One, two, four and more planes a node: tests, memory and time."""
    workload = intervals.scene(lab)
    specs = {n: joined(tree, "traversal=ordered") for n, tree in PLANES.items()}
    found = pictures(lab, workload, tuple(specs.values()))
    tests = [found[spec].counters["tests"] for spec in specs.values()]
    listed = ", ".join(
        f"{n} {size_of(lab, workload, spec) / 2**20:.1f} MiB and {found[spec].seconds * 1e3:.0f} ms"
        for n, spec in specs.items()
    )
    yield Outcome(
        "best",
        verdict(holds=tests[0] >= tests[1] >= tests[2]),
        f"{workload.name}: triangle tests per ray with 1, 2 and 4 planes a node: "
        f"{tests[0]:.1f}, {tests[1]:.1f}, {tests[2]:.1f}; memory and picture: {listed}",
        steps(found),
        lab.error(workload, tuple(specs.values())),
        {f"{n} planes": found[spec].seconds for n, spec in specs.items()},
    )


def oblique(lab: Lab) -> Iterator[Outcome]:
    """Planes along diagonals, which the source advises against."""
    workload = intervals.scene(lab)
    axes, spec = OBLIQUE
    found = pictures(lab, workload, OBLIQUE)
    share = found[spec].seconds / found[axes].seconds
    yield Outcome(
        "best",
        verdict(holds=share >= 1),
        f"{workload.name}: with oblique planes a picture takes {share:.2f} of the time with planes along the axes",
        steps(found),
        lab.error(workload, OBLIQUE),
        {"ratio": share},
    )


def groups(lab: Lab) -> Iterator[Outcome]:
    """Packets and tiles through the boxes that intervals leave, against those through the intervals."""
    workload = intervals.scene(lab)
    for configuration, way in GROUPS.items():
        specs = (f"bih:traversal={way}", f"bih-bvh:traversal={way}", PLAIN)
        found = pictures(lab, workload, specs)
        share = found[specs[1]].seconds / found[specs[0]].seconds
        yield Outcome(
            configuration,
            verdict(holds=share < 1),
            f"{workload.name}: {specs[1]} takes {share:.2f} of the time of {specs[0]}, and "
            f"{found[specs[1]].seconds / found[PLAIN].seconds:.2f} of that of {PLAIN}",
            steps(found),
            lab.error(workload, specs),
            {"ratio": share},
        )


def holes(lab: Lab) -> Iterator[Outcome]:
    """Wrong answers on singular rays without error bounds: of a kd-tree, and of intervals."""
    cases = [case for case in lab.native.cases() if case["name"] in HOLES]
    asked = sum(len(case["origins"]) for case in cases)
    for configuration, kd in UNGUARDED.items():
        specs = (kd, "bih:robust=none,traversal=ordered")
        wrong = dict.fromkeys(specs, 0)
        for case in cases:
            for spec, errors, *_ in stability.case_errors(lab.native, case, list(specs), exact_pairs=0):
                wrong[spec] += errors.wrong
                lab.compared(case["name"], spec, "singular", errors)
        yield Outcome(
            configuration,
            verdict(holds=wrong[specs[1]] == 0),
            f"of {asked:,} rays in walls, along edges and through corners, wrong: "
            + ", ".join(f"{spec} {number:,}" for spec, number in wrong.items()),
            "no triangle is cut in the build of intervals, nor in that of kd-sah; all lose hits by the rounding of "
            "distances to planes, and none does with error bounds",
            f"{sum(wrong.values()):,} of {len(specs) * asked:,} answers differ from brute force",
            {spec: float(number) for spec, number in wrong.items()},
        )


CLAIMS = (
    Claim(
        "intervals-and-boxes",
        PAPER,
        "Building and storing intervals is comparable to a hierarchy of boxes.",
        against_boxes,
        (SCENE,),
    ),
    Claim(
        "intervals-candidates",
        PAPER,
        "The global heuristic, which needs the scene's box alone, builds fastest.",
        candidates,
        (SCENE,),
    ),
    Claim(
        "intervals-fifth-case",
        PAPER,
        "A fifth case, nodes of one child between two planes, cuts empty space off on both sides.",
        fifth_case,
        (SCENE,),
    ),
    Claim("intervals-planes", PAPER, "More planes a node separate objects better.", planes, (SCENE,)),
    Claim("intervals-oblique", PAPER, "Planes that are not axis-aligned are less desirable.", oblique, (SCENE,)),
    Claim(
        "intervals-groups",
        PAPER,
        "Traversed as boxes, intervals serve large bundles of rays faster.",
        groups,
        (SCENE,),
    ),
    Claim(
        "intervals-holes",
        PAPER,
        "Without triangle clipping no intersection goes undetected, unlike in kd-trees.",
        holes,
    ),
)
