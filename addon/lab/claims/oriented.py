# SPDX-License-Identifier: GPL-3.0-or-later
"""Vitsas and others 2023: oriented boxes fit tighter than boxes along the axes, and rays gain by it.

Both trees come from the same build over boxes along the axes, as in the paper, and rays go through both one by one.
"""

from __future__ import annotations

from collections.abc import Iterator

from . import kd, paper_scenes
from .claims import UNTESTED, Claim, Lab, Outcome, verdict

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
        shares["time"] = own.seconds / other.seconds
        yield Outcome(
            "best",
            verdict(holds=max(shares.values()) < 1),
            f"{workload.name}: rays visit {shares['steps']:.2f} of the nodes and test {shares['tests']:.2f} of the "
            f"triangles, in {shares['time']:.2f} of the time of {ALONG}",
            f"per ray: {ALONG} {other.counters['steps']:.1f} nodes and {other.counters['tests']:.1f} tests; {TURNED} "
            f"{own.counters['steps']:.1f} and {own.counters['tests']:.1f}; a turned node first turns the ray",
            lab.error(workload, [ALONG, TURNED]),
            shares,
        )


CLAIMS = (
    Claim(
        "oriented-boxes-fit",
        PAPER,
        "Oriented boxes fit tighter than boxes along the axes, and answer rays quicker.",
        tighter,
        kd.SCENES,
    ),
)
