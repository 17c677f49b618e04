# SPDX-License-Identifier: GPL-3.0-or-later
"""Wächter and Keller: intervals instead of planes, for little memory and short builds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...core.measure import counting
from ...core.scene.workload import Workload
from . import paper_scenes
from .claims import Builds, Chart, Claim, Lab, Outcome, Share, Timing, verdict

PAPER = "Wächter and Keller, Instant ray tracing: the bounding interval hierarchy (2006)"

INTERVALS = {"faithful": "bih:traversal=ordered,leaves=scalar", "best": "bih:traversal=ordered"}
KD = {"faithful": "kd-sah:traversal=dir,leaves=scalar", "best": "kd:traversal=dir"}
"""The kd-trees compared with: unclipped triangles in leaves, and triangles clipped to their cells; planes alone,
because boxes take memory and time of their own. All rays go one by one, and as published test one triangle at a time.
"""

BUILDS, MEMORY = 8.0, 0.5
"""The paper's 'a fraction' as numbers: build at least 8 times faster, at most half the memory."""

COMPARABLE = 1.5
"""The paper's 'about as long' as a number: at most this ratio of times."""

SIZE = (1024, 1024)
"""Width and height of a picture in pixels: about a million rays."""

FRAMES = (1, 2, 4, 8, 16, 32)
SCENE = "stanford-dragon"


def measured(lab: Lab, workload: Workload, specs: tuple[str, str]) -> tuple[Builds, Mapping[str, Timing], list[float]]:
    """Build times, times of a picture by configuration, and bytes."""
    builds = lab.build_seconds(workload, specs)
    view = partial(paper_scenes.camera_rays, workload, SIZE)
    some = lab.rays(workload, "{}x{}".format(*SIZE), view)
    return (
        builds,
        lab.seconds(workload, specs, some),
        [float(lab.statistics(workload, spec)["bytes"]) for spec in specs],
    )


def scene(lab: Lab) -> Workload:
    """The scanned dragon; scattered triangles if its file is missing."""
    return lab.shared(SCENE) or paper_scenes.scattered()


def small_and_quick(lab: Lab) -> Iterator[Outcome]:
    """Build time and memory against kd-trees."""
    workload = scene(lab)
    for configuration, kd in KD.items():
        own = INTERVALS[configuration]
        made, _, size = measured(lab, workload, (own, kd))
        builds = made.seconds
        faster, share = builds[kd] / builds[own], size[0] / size[1]
        small = [lab.statistics(workload, spec) for spec in (own, kd)]
        yield Outcome(
            configuration,
            verdict(made.share(kd, own).above(BUILDS), holds=share <= MEMORY),
            f"{workload.name}, {len(workload.triangles):,} triangles: {own} builds in "
            f"{builds[own] * 1e3:.0f} ms, {kd} in {builds[kd] * 1e3:.0f} ms, {faster:.1f} times as long "
            f"({made.method}; limit: {BUILDS:g}); memory {size[0] / 2**20:.1f} of {size[1] / 2**20:.1f} MiB, "
            f"{share:.2f} (limit: {MEMORY:g})",
            "; ".join(
                f"{spec} {int(s['nodes_axis']):,} inner nodes, {int(s['references']):,} triangles in leaves"
                for spec, s in zip((own, kd), small, strict=True)
            ),
            lab.error(workload, [own, kd]),
            {"build_ratio": faster, "memory_ratio": share},
        )


def to_image(lab: Lab) -> Iterator[Outcome]:
    """Build and pictures together: the cost of an animation that rebuilds for each picture."""
    workload = scene(lab)
    for configuration, kd in KD.items():
        own = INTERVALS[configuration]
        specs = (own, kd)
        made, found, _ = measured(lab, workload, specs)
        builds = made.seconds
        frames = {spec: timing.seconds for spec, timing in found.items()}
        total = {spec: builds[spec] + frames[spec] for spec in specs}
        # Find the number of pictures after which the kd-tree's faster traversal repays its longer build.
        gain = frames[own] - frames[kd]
        even = (builds[kd] - builds[own]) / gain if gain > 0 else float("inf")
        yield Outcome(
            configuration,
            Share.of(total[own] / total[kd]).below(),
            f"{workload.name}: build and a picture of 1,048,576 rays take {total[own] * 1e3:.0f} ms with "
            f"{own}, {total[kd] * 1e3:.0f} ms with {kd}; {kd} is ahead after "
            f"{'no number of' if even == float('inf') else f'{even:.0f}'} pictures of one build",
            "; ".join(
                f"{spec}: build {builds[spec] * 1e3:.0f} ms, picture {frames[spec] * 1e3:.0f} ms" for spec in specs
            )
            + f" (builds: {made.method})",
            lab.error(workload, specs),
            {spec: total[spec] for spec in specs},
            (
                Chart(
                    f"{workload.name}: build and pictures",
                    "pictures",
                    "seconds",
                    {spec: [(n, builds[spec] + n * frames[spec]) for n in FRAMES] for spec in specs},
                ),
            ),
        )


def comparable(lab: Lab) -> Iterator[Outcome]:
    """Pictures alone, without the build."""
    workload = scene(lab)
    for configuration, kd in KD.items():
        own = INTERVALS[configuration]
        _, found, _ = measured(lab, workload, (own, kd))
        ratio = found[own].share(found[kd])
        told = (
            f"{spec} {t.counters['steps']:.1f} nodes and {t.counters['tests']:.1f} tests" for spec, t in found.items()
        )
        yield Outcome(
            configuration,
            ratio.below(COMPARABLE),
            f"{workload.name}: a picture takes {ratio.value:.2f} times as long with {own} as with {kd} "
            f"(limit: at most {COMPARABLE:g})",
            f"per ray: {'; '.join(told)}" + counting.remark({spec: spec for spec in found}, lab.native),
            lab.error(workload, (own, kd)),
            {"ratio": ratio.value},
        )


QUICK = ("bvh-hlbvh:traversal=ordered", "bvh-ploc:traversal=ordered")
"""Boxes from triangles that are sorted along a curve: Pantaleoni and Luebke 2010, Meister and Bittner 2018."""


def against_sorted_boxes(lab: Lab) -> Iterator[Outcome]:
    """Build and a picture of the global grid's intervals against the quick builds of boxes that came later."""
    workload = scene(lab)
    own = INTERVALS["best"]
    for other in QUICK:
        made, found, size = measured(lab, workload, (own, other))
        total = {spec: made.seconds[spec] + timing.seconds for spec, timing in found.items()}
        share = Share.of(total[own] / total[other])
        yield Outcome(
            "best",
            share.below(),
            f"{workload.name}: build and a picture of 1,048,576 rays take {total[own] * 1e3:.0f} ms with {own}, "
            f"{total[other] * 1e3:.0f} ms with {other}: {share.value:.2f}; memory {size[0] / size[1]:.2f}",
            "; ".join(
                f"{spec}: build {made.seconds[spec] * 1e3:.0f} ms, picture {timing.seconds * 1e3:.0f} ms, "
                f"{timing.counters['steps']:.1f} nodes and {timing.counters['tests']:.1f} tests a ray"
                for spec, timing in found.items()
            )
            + f" (builds: {made.method})",
            lab.error(workload, (own, other)),
            {"ratio": share.value, "build": made.seconds[own] / made.seconds[other], "memory": size[0] / size[1]},
        )


CLAIMS = (
    Claim(
        "intervals-small-and-quick",
        PAPER,
        "Building and storing intervals takes a fraction of the time and memory of a kd-tree.",
        small_and_quick,
        (SCENE,),
    ),
    Claim(
        "intervals-walks",
        PAPER,
        "Rays take about as long through intervals as through a kd-tree.",
        comparable,
        (SCENE,),
    ),
    Claim(
        "intervals-first-picture",
        PAPER,
        "The time to the first picture is shorter than with a kd-tree.",
        to_image,
        (SCENE,),
    ),
    Claim(
        "intervals-sorted-boxes",
        PAPER,
        "The time to the first picture is the shortest of all (against boxes sorted along a curve, which came later).",
        against_sorted_boxes,
        (SCENE,),
    ),
)
