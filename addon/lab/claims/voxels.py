# SPDX-License-Identifier: GPL-3.0-or-later
"""Amanatides and Woo 1987: from one cell of a grid to the next by two comparisons and one addition; one test of a
triangle that lies in several cells.

A step is timed without triangle tests, over grids of several resolutions, next to a node of a kd-tree, which takes two
to four comparisons, a difference and a product (`cases.py`). Ours is not the published step, which adds up
distances and so may miss a cell; there is no faithful configuration.
"""

from __future__ import annotations

from collections.abc import Iterator

from . import kd
from .claims import UNTESTED, Chart, Claim, Lab, Outcome, Share, verdict

PAPER = "Amanatides and Woo, A fast voxel traversal algorithm for ray tracing (1987)"

DENSITIES = (0.5, 4.0, 32.0)
"""Cells per triangle of the grids."""

NODE = "kd:traversal=dir"
"""The tree whose nodes a step is compared with."""

WITHOUT = {"faithful": "kd-sah:traversal=dir,leaves=scalar", "best": "kd:traversal=dir,leaves=scalar"}
"""Trees whose rays test a triangle in each leaf that holds it."""

MAILBOX = "mailbox=hashed"


def step(lab: Lab) -> Iterator[Outcome]:
    """The time of a step in each grid against that of a node of a kd-tree."""
    specs = {density: f"grid:density={density:g},traversal=steps" for density in DENSITIES}
    for workload in kd.scenes(lab):
        if not kd.ray_sets(lab, workload):
            yield Outcome("best", UNTESTED, f"{workload.name}: no ray hits the scene")
            continue
        found = kd.times(lab, workload, [NODE, *specs.values()], alone=True)
        each = {one: timing.nanoseconds / max(timing.counters["steps"], 1e-9) for one, timing in found.items()}
        shares = {density: Share.of(each[spec] / each[NODE]) for density, spec in specs.items()}
        yield Outcome(
            "best",
            verdict(*(share.below() for share in shares.values())),
            f"{workload.name}: a step takes "
            + ", ".join(f"{each[specs[one]]:.1f} ns at {one:g} cells a triangle" for one in DENSITIES)
            + f"; a node of {NODE} {each[NODE]:.1f} ns",
            "steps a ray: "
            + ", ".join(f"{one} {timing.counters['steps']:.1f}" for one, timing in found.items())
            + "; a step here takes the distance of the next wall from the wall's own coordinate, with an error bound "
            "on either side, since sums of steps may pass by a cell",
            lab.error(workload, [NODE, *specs.values()]),
            {f"density {density:g}": share.value for density, share in shares.items()},
            (
                Chart(
                    f"{workload.name}: time of a step",
                    "cells a triangle",
                    "ns a step",
                    {"grid": [(density, each[spec]) for density, spec in specs.items()]},
                    level=(each[NODE], NODE),
                ),
            ),
        )


def mailboxes(lab: Lab) -> Iterator[Outcome]:
    """Tests and time of rays with and without mailboxes."""
    for workload in kd.scenes(lab):
        if not kd.ray_sets(lab, workload):
            yield Outcome("best", UNTESTED, f"{workload.name}: no ray hits the scene")
            continue
        for configuration, without in WITHOUT.items():
            kept = f"{without},{MAILBOX}"
            found = kd.times(lab, workload, [without, kept], alone=False)
            share = found[kept].share(found[without])
            tests = found[kept].counters["tests"] / max(found[without].counters["tests"], 1e-9)
            yield Outcome(
                configuration,
                verdict(share.below()),
                f"{workload.name}: with a mailbox {found[kept].counters['tests']:.1f} tests a ray, "
                f"{tests:.2f} of those without, in {share.value:.2f} of the time",
                f"{kept} against {without}; each ray keeps the triangles that it has tested, not each triangle the "
                "last ray, so that threads share nothing",
                lab.error(workload, [without, kept]),
                {"tests": tests, "time": share.value},
            )


CLAIMS = (
    Claim(
        "voxel-step",
        PAPER,
        "The next cell costs two comparisons and one addition, less than a node of a tree.",
        step,
        kd.SCENES,
    ),
    Claim(
        "mailboxes",
        PAPER,
        "A ray that tests a triangle once, for all cells that hold it, is quicker.",
        mailboxes,
        kd.SCENES,
    ),
)
