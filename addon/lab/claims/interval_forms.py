# SPDX-License-Identifier: GPL-3.0-or-later
"""Wächter and Keller, the forms of interval hierarchies: against boxes, by split candidate, the fifth case, one, two,
four or more planes, oblique planes, rays in groups, and rays without error bounds.

Every form is compared with the plain hierarchy in the same run, and with kd-trees where the source names them; the best
of these clips its triangles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from ...core.measure.accuracy import Errors
from ...core.scene.workload import Workload
from ...core.structures.specs import joined
from . import intervals, kd, paper_scenes
from .claims import Checked, Claim, Lab, Outcome, Timing, verdict
from .intervals import PAPER, SCENE

PLAIN = intervals.INTERVALS

BOXES = {"faithful": "bvh-sah:width=2,traversal=ordered,leaves=scalar", "best": "bvh-sah:traversal=ordered"}
"""Hierarchies of boxes: two to a node as published, and eight."""

ALIKE = 1.5
"""The source's 'comparable' as a number: at most this ratio."""

SPLITS = {name: f"bih:split={name},traversal=ordered" for name in ("middle", "median", "sah")} | {"grid": PLAIN["best"]}
FIFTH = {"faithful": "bih5:cut=split,traversal=ordered,leaves=scalar", "best": "bih5:traversal=ordered"}
PLANES = {"1": "bih1", "2": "bih", "4": "bih-n:n=2", "8": "bih-n", "16": "bih-n:n=8"}
"""Hierarchies by the number of planes of a node."""

OBLIQUE = ("bih-obl:k=3,traversal=ordered", "bih-obl:traversal=ordered")
"""The same hierarchy along the axes alone, and with planes along diagonals."""

GROUPS = {"faithful": "packet", "best": "tile"}
BARE = "bih:robust=none,traversal=ordered"
"""Intervals without error bounds, and kd-trees."""

ROUNDED = ("bih-obl:robust=none,traversal=ordered", "bih-sah:robust=none,traversal=ordered", BARE)
"""Hierarchies without error bounds, that with oblique planes first."""

AS_BOXES = "bih-bvh:traversal=packet"
STORED = {"faithful": "bvh-sah:width=2,traversal=packet", "best": "bvh-sah:traversal=packet"}
"""Intervals that packets traverse as boxes, and stored boxes."""

UNGUARDED = {"faithful": "kd-sah:robust=none,traversal=dir", "best": "kd:robust=none,traversal=dir"}


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
        own = PLAIN[configuration]
        specs = (own, boxes)
        builds = lab.build_seconds(workload, specs)
        found = pictures(lab, workload, specs)
        values = {
            "build": builds.seconds[own] / builds.seconds[boxes],
            "memory": size_of(lab, workload, own) / size_of(lab, workload, boxes),
            "picture": found[own].seconds / found[boxes].seconds,
        }
        yield Outcome(
            configuration,
            verdict(builds.share(own, boxes).below(ALIKE), holds=values["memory"] <= ALIKE),
            f"{workload.name}: {own} takes {values['build']:.2f} of the build ({builds.method}), "
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
    listed = ", ".join(
        f"{name} {builds.seconds[spec] * 1e3:.0f} and {found[spec].seconds * 1e3:.0f}" for name, spec in SPLITS.items()
    )
    yield Outcome(
        "best",
        verdict(*(builds.share(SPLITS["grid"], spec).below() for name, spec in SPLITS.items() if name != "grid")),
        f"{workload.name}: ms of the build ({builds.method}) and of a picture: {listed}",
        steps(found),
        lab.error(workload, tuple(SPLITS.values())),
        {f"build {name}": builds.seconds[spec] for name, spec in SPLITS.items()}
        | {f"picture {name}": found[spec].seconds for name, spec in SPLITS.items()},
    )


def fifth_case(lab: Lab) -> Iterator[Outcome]:
    """Nodes of one child, as published and by surface, against the same tree without cuts."""
    workload = intervals.scene(lab)
    for configuration, spec in FIFTH.items():
        own = PLAIN[configuration]
        bare = joined(own, "empty=0")
        specs = (bare, own, spec)
        found = pictures(lab, workload, specs)
        share = found[spec].share(found[bare])
        memory = size_of(lab, workload, spec) / size_of(lab, workload, bare)
        yield Outcome(
            configuration,
            share.below(),
            f"{workload.name}: a picture takes {share.value:.2f} of the time of {bare} with {spec}, "
            f"{found[own].seconds / found[bare].seconds:.2f} with {own}, which cuts by empty leaves; memory "
            f"{memory:.2f}",
            steps(found),
            lab.error(workload, specs),
            {"ratio": share.value, "memory": memory},
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
    share = found[spec].share(found[axes])
    yield Outcome(
        "best",
        share.above(),
        f"{workload.name}: with oblique planes a picture takes {share.value:.2f} of the time with planes along axes",
        steps(found),
        lab.error(workload, OBLIQUE),
        {"ratio": share.value},
    )


def groups(lab: Lab) -> Iterator[Outcome]:
    """Packets and tiles through the boxes that intervals leave, against those through the intervals."""
    workload = intervals.scene(lab)
    for configuration, way in GROUPS.items():
        specs = (f"bih:traversal={way}", f"bih-bvh:traversal={way}", PLAIN[configuration])
        found = pictures(lab, workload, specs)
        share = found[specs[1]].share(found[specs[0]])
        yield Outcome(
            configuration,
            share.below(),
            f"{workload.name}: {specs[1]} takes {share.value:.2f} of the time of {specs[0]}, and "
            f"{found[specs[1]].seconds / found[specs[2]].seconds:.2f} of that of {specs[2]}",
            steps(found),
            lab.error(workload, specs),
            {"ratio": share.value},
        )


def holes(lab: Lab) -> Iterator[Outcome]:
    """Wrong answers on singular rays without error bounds: of a kd-tree, and of intervals."""
    for configuration, tree in UNGUARDED.items():
        found = kd.singular_errors(lab, (tree, BARE))
        yield Outcome(
            configuration,
            verdict(holds=found[BARE].wrong == 0),
            wrong_of(found),
            "no triangle is cut in the build of intervals, nor in that of kd-sah; all lose hits by the rounding of "
            "distances to planes, and none does with error bounds",
            Checked.of(found, found.values()),
            {spec: float(errors.wrong) for spec, errors in found.items()},
        )


def unstable(lab: Lab) -> Iterator[Outcome]:
    """Wrong answers on singular rays without error bounds: of oblique planes, and of planes along the axes."""
    own, *others = ROUNDED
    found = kd.singular_errors(lab, ROUNDED)
    yield Outcome(
        "best",
        verdict(holds=found[own].wrong > max(found[spec].wrong for spec in others)),
        wrong_of(found),
        "the singular rays lie in planes along the axes, where most oblique planes do not; the heights of triangles "
        "along oblique directions are rounded outwards in the build",
        Checked.of(found, found.values()),
        {spec: float(errors.wrong) for spec, errors in found.items()},
    )


def low_memory(lab: Lab) -> Iterator[Outcome]:
    """Memory of intervals that rays traverse as boxes, whole and along a ray, against stored boxes."""
    workload = intervals.scene(lab)
    for configuration, boxes in STORED.items():
        specs = (AS_BOXES, boxes)
        found = pictures(lab, workload, specs)
        bytes_of = {spec: size_of(lab, workload, spec) for spec in specs}
        nodes = {spec: lab.statistics(workload, spec)["nodes_axis"] for spec in specs}
        met = {spec: found[spec].counters["steps"] * bytes_of[spec] / max(nodes[spec], 1) for spec in specs}
        memory, along = (own[AS_BOXES] / max(own[boxes], 1e-9) for own in (bytes_of, met))
        yield Outcome(
            configuration,
            verdict(holds=memory < 1 and along < 1),
            f"{workload.name}: {AS_BOXES} takes {memory:.2f} of the memory of {boxes} "
            f"({bytes_of[AS_BOXES] / 2**20:.1f} of {bytes_of[boxes] / 2**20:.1f} MiB); a ray meets {along:.2f} of the "
            f"bytes ({met[AS_BOXES]:.0f} of {met[boxes]:.0f}), leaves included",
            steps(found) + "; nodes that a packet visits together count once. Cache misses are not counted",
            lab.error(workload, specs),
            {"memory": memory, "along a ray": along},
        )


def wrong_of(found: Mapping[str, Errors]) -> str:
    """The wrong answers of each structure on singular rays, as text."""
    return (
        f"of {next(iter(found.values())).rays:,} rays in walls, along edges and through corners, wrong: "
        + ", ".join(f"{spec} {errors.wrong:,}" for spec, errors in found.items())
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
        "intervals-stability",
        PAPER,
        "Planes that are not axis-aligned decrease the numerical stability.",
        unstable,
    ),
    Claim(
        "intervals-boxes-memory",
        PAPER,
        "Built as intervals and traversed as boxes, the use of memory and cache stays low.",
        low_memory,
        (SCENE,),
    ),
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
