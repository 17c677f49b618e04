# SPDX-License-Identifier: GPL-3.0-or-later
"""Vitsas and others 2023: oriented boxes fit tighter than boxes along the axes, and rays gain by it.

Both trees come from the same build over boxes along the axes, as in the paper, and rays go through both one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ...core.scene.workload import Workload
from . import kd, paper_scenes
from .claims import FAILS, HOLDS, UNTESTED, Claim, Lab, Outcome, verdict

PAPER = (
    "Vitsas, Evangelou, Papaioannou and Gkaravelis, Parallel transformation of bounding volume hierarchies into "
    "oriented bounding box trees (2023)"
)

TURNED, ALONG = "obb:traversal=ordered", "bvh-sah:traversal=ordered"
"""Oriented boxes, and boxes along the axes."""


def tighter(lab: Lab) -> Iterator[Outcome]:
    """Boxes and triangles that rays visit, and their time, against boxes along the axes."""
    for workload in (paper_scenes.needles(), *kd.scenes(lab)):
        if not kd.ray_sets(lab, workload):
            yield Outcome("best", UNTESTED, f"{workload.name}: no ray hits the scene")
            continue
        found = kd.times(lab, workload, [ALONG, TURNED], alone=False)
        own, other = found[TURNED], found[ALONG]
        shares = {name: own.counters[name] / max(other.counters[name], 1e-9) for name in ("steps", "tests")}
        time = own.share(other)
        yield Outcome(
            "best",
            verdict(time.below(), holds=max(shares.values()) < 1),
            f"{workload.name}: rays visit {shares['steps']:.2f} of the nodes and test {shares['tests']:.2f} of the "
            f"triangles, in {time.value:.2f} of the time of {ALONG}",
            f"per ray: {ALONG} {other.counters['steps']:.1f} nodes and {other.counters['tests']:.1f} tests; {TURNED} "
            f"{own.counters['steps']:.1f} and {own.counters['tests']:.1f}; a turned node first turns the ray",
            lab.error(workload, [ALONG, TURNED]),
            {**shares, "time": time.value},
        )


AXES = "thin, parallel to the axes"
"""The kind of scene in which nothing is to be gained."""

KINDS: dict[str, Callable[[], Workload]] = {
    "thin and oblique": lambda: paper_scenes.needles("along a diagonal"),
    "thin, in all directions": lambda: paper_scenes.needles("in all directions"),
    "hair": paper_scenes.hair,
    AXES: lambda: paper_scenes.needles("along the axes"),
}
"""Scenes by their kind."""

PLAIN = "obb:frames=1,traversal=ordered"
"""The same build and traversal with no box turned, which the paper compares with."""

PAIRS = (("faithful", TURNED, PLAIN), ("best", TURNED, ALONG), ("best", "obb", "bvh-sah"))
"""Rotated boxes and their counterparts, by configuration; the last two trees send rays together."""


def kinds(lab: Lab) -> Iterator[Outcome]:
    """Time, steps, tests and bytes against boxes along the axes, by kind of scene."""
    for kind, make in KINDS.items():
        workload = make()
        found = kd.times(lab, workload, sorted({spec for _, *pair in PAIRS for spec in pair}), alone=False)
        sizes = {spec: lab.statistics(workload, spec)["bytes"] / 1e6 for spec in found}
        for configuration, own, other in PAIRS:
            share = found[own].share(found[other])
            pays = share.below()
            work = (
                f"{spec} {found[spec].counters['steps']:.1f} nodes, {found[spec].counters['tests']:.1f} tests, "
                f"{sizes[spec]:.2f} MB"
                for spec in (own, other)
            )
            yield Outcome(
                configuration,
                pays if kind != AXES else FAILS if pays == HOLDS else HOLDS,
                f"{workload.name} ({kind}): {own} takes {share.value:.2f} of the time of {other}",
                f"per ray: {'; '.join(work)}",
                lab.error(workload, [own, other]),
                {
                    "time": share.value,
                    "tests": found[own].counters["tests"] / max(found[other].counters["tests"], 1e-9),
                },
            )


CLAIMS = (
    Claim(
        "oriented-boxes-fit",
        PAPER,
        "Oriented boxes fit tighter than boxes along the axes, and answer rays quicker.",
        tighter,
        kd.SCENES,
    ),
    Claim(
        "oriented-boxes-kinds",
        PAPER,
        "Rotated boxes pay on a CPU where geometry is thin and not parallel to the axes.",
        kinds,
    ),
)
